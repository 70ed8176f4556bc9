"""How rare a sum of squares is, as the equally rare deviation of a normal variable."""

from __future__ import annotations

import math


def deviation(squares: float, dof: float, scale: float = 1.0, scale_dof: float = math.inf) -> float:
    """Deviation of a sum of squares of `dof` standard normal variables.

    With a scale of the variances that was itself measured with `scale_dof` degrees of freedom, the ratio is Fisher's F,
    whose cube root is nearly normal (Paulson, 1942; Wilson and Hilferty for a scale that is known).
    """
    if dof <= 0.0:
        return 0.0
    ratio = math.cbrt(max(squares, 0.0) / (dof * scale))
    own, other = 2.0 / (9.0 * dof), 2.0 / (9.0 * scale_dof)
    return ((1.0 - other) * ratio - (1.0 - own)) / math.sqrt(own + ratio**2 * other)

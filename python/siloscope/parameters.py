"""Names and order of the parameters, laws and constants that several modules share."""

from __future__ import annotations

import math

from siloscope import _core

PARAMETERS = _core.PARAMETERS
"""Order of the parameters: pose; radius; cone (its radius b − m·z: slope m, intercept b); depth bias; ovality."""

SIZE = len(PARAMETERS)

POSE = PARAMETERS[:4]
"""Names of the pose's parameters (Eqs. 5 to 7)."""

BIAS = PARAMETERS[7:10]
"""Names of the depth bias' parameters: ``measured = d + offset + scale·d + quadratic·d²`` (Eqs. 8 to 10)."""

OVALITY = slice(PARAMETERS.index("oval_cos"), SIZE)
"""Where the radius' second harmonic stands, as fractions of the radius: cosine and sine."""

NOISE = ("floor", "constant", "linear", "quadratic", "power_factor", "power")
"""Names of the noise law's parameters, ``max(floor, constant + linear·d + quadratic·d² + power_factor·d^power)``."""


GRAVITY = 9.81
"""Of the earth, m/s²; from 9.78 at the equator to 9.83 at the poles."""


def noise_std(law: tuple[float, float, float, float, float, float], depth: float) -> float:
    """Standard deviation of a noise law, in the order of `NOISE`, at a true depth, m."""
    floor, constant, linear, quadratic, factor, power = law
    return max(floor, constant + linear * depth + quadratic * depth**2 + factor * math.pow(depth, power))

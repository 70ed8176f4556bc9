"""What one frame says about all parameters, and frames added up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.parameters import SIZE
from siloscope.types.by_value import ByValue

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FrameFactor(ByValue):
    """What one frame says about all parameters, without priors: what `calibrate` fuses.

    Vectors are (12,) in the order of `PARAMETERS`, matrices (12, 12). Near `parameters` the frame's negative
    log-likelihood is ``gradient @ δ + δ @ information @ δ / 2``. What was known before the frame (sensor profile,
    diameter, gravity) stands beside it, because it is common to all frames.
    """

    parameters: NDArray[np.float64]
    """The answer with the silo's ovality estimated; NaN where a part was not seen."""
    information: NDArray[np.float64]
    """Information of this frame alone."""
    gradient: NDArray[np.float64]
    """Gradient of this frame's negative log-likelihood at `parameters`."""
    scatter: NDArray[np.float64]
    """Covariance of `gradient` as the residuals have it."""
    noise: NDArray[np.float64]
    """The part of `scatter` that the sensor's noise makes; the rest (the wall's own shape, the lens) may come back."""
    free: NDArray[np.bool_]
    """Which parameters were estimated."""
    prior_mean: NDArray[np.float64]
    """What was expected before; NaN where nothing was."""
    prior_information: NDArray[np.float64]
    """How firmly, as 1/variance; 0 where nothing was expected."""
    scale_std: float
    """Standard deviation of the depth scale where no frame can tell it, else 0."""
    linearization_point: NDArray[np.float64]
    """Where the frame's equations were made, near `parameters`; NaN where they are."""
    rays: NDArray[np.float64]
    """(K, 3): (x, y) of rays (x, y, 1) to some of the wall that was seen, and their information, 1/m². None where the
    depth bias is known: the equations hold far enough."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data; of symmetric matrices only the upper triangle, row by row."""
        return {
            **{name: nullable(getattr(self, name)) for name in _VECTORS},
            "base": nullable(self.linearization_point),
            **{name: _triangle(getattr(self, name)) for name in _MATRICES},
            "free": [bool(f) for f in self.free],
            "rays": self.rays.tolist(),
            "scale_std": self.scale_std,
        }


@dataclass(frozen=True, eq=False, repr=False)
class SummedFactor(ByValue):
    """Factors added up about `origin` (12,): what remains of frames whose own factor is not kept.

    `information` is Σ w Λ, `pull` Σ w (Λ (θ - origin) - g), `noise` Σ w² N, `weight` Σ w; and `weight`
    times `shared` is what the frames may share.
    """

    origin: Vector
    information: Matrix
    pull: Vector
    noise: Matrix
    shared: Matrix
    weight: float
    frames: int
    prior_information: Vector
    prior_mean: Vector

    @classmethod
    def nothing(cls) -> SummedFactor:
        """No frames."""
        zero, none = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
        return cls(none, zero, none, zero, zero, 0.0, 0, none, none)

    def to_dict(self) -> dict[str, Any]:
        """Plain data; of symmetric matrices only the upper triangle, row by row."""
        return {
            **{name: getattr(self, name).tolist() for name in _SUM_VECTORS},
            **{name: _triangle(getattr(self, name)) for name in _SUM_MATRICES},
            "weight": self.weight,
            "frames": self.frames,
        }


_UPPER = np.triu_indices(SIZE)
_VECTORS = ("parameters", "gradient", "prior_mean", "prior_information")
_MATRICES = ("information", "scatter", "noise")
_SUM_VECTORS = ("origin", "pull", "prior_information", "prior_mean")
_SUM_MATRICES = ("information", "noise", "shared")


def nullable(values: Vector) -> list[float | None]:
    """A vector as plain data; None where it is not a number."""
    return [float(v) if math.isfinite(v) else None for v in values]


def _triangle(matrix: Matrix) -> list[float]:
    upper: list[float] = matrix[_UPPER].tolist()
    return upper

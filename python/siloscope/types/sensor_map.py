"""What one device reads wrong over its image, as far as it lasts and grows with the depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.types.by_value import ByValue

Grid = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class SensorMap(ByValue):
    """Error of the depth on a grid over the image: ``reading = z + error · z^power``, z what the profile expects, in m.

    The grid's outer nodes are the centres of the image's corner pixels, whatever its size.
    """

    power: int
    """1: proportional to the depth, as of times of flight; 2: to its square, as of disparities."""
    error: Grid
    """(rows, columns), m^(1 - power)."""
    std: Grid
    """(rows, columns) standard deviations, which neighbouring nodes have in common."""
    opens: Grid
    """(7, 7) covariance that the map leaves open of pose, radius and cone where it was learned, in the order of
    `siloscope.parameters.PARAMETERS`; answers by this sensor contain it."""

    def over(self, shape: tuple[int, int]) -> Grid:
        """The error (H, W) at the pixels of an image, bilinear."""
        down, across = (_between(size, nodes) for size, nodes in zip(shape, self.error.shape, strict=True))
        over: Grid = down @ self.error @ across.T
        return over

    def corrected(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Depth (H, W) in metres without the error; 0 stays 0."""
        error = self.over((depth.shape[0], depth.shape[1]))
        if self.power == 1:
            return (depth / (1.0 + error)).astype(np.float32)
        return (2.0 * depth / (1.0 + np.sqrt(np.maximum(1.0 + 4.0 * error * depth, 0.0)))).astype(np.float32)

    def widened(self, covariance: Grid) -> Grid:
        """A covariance of the pose (4, 4), or of all parameters, with what the map leaves open of what is free."""
        made, size = covariance.copy(), min(len(covariance), len(self.opens))
        free = np.diag(covariance)[:size] > 0.0
        made[:size, :size] += self.opens[:size, :size] * free * free[:, None]
        return made

    def to_dict(self) -> dict[str, Any]:
        """Plain data; errors to 1e-7."""
        return {
            "power": self.power,
            "error": np.round(self.error, 7).tolist(),
            "std": np.round(self.std, 7).tolist(),
            "opens": self.opens.tolist(),
        }


def _between(size: int, nodes: int) -> Grid:
    """(size, nodes) weights of the nodes at each pixel."""
    place = np.linspace(0.0, nodes - 1.0, size)
    weights: Grid = np.maximum(1.0 - np.abs(place[:, None] - np.arange(nodes)), 0.0)
    return weights

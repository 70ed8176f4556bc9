"""A surface as it is kept: 32 x 32 heights, their deviations and what each cell shows, in millimetres, compressed."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from siloscope.types.surface_map import SurfaceMap

SIDE = 32
"""Cells along x and y."""

NONE = 65_535
"""What stands for no height."""

_HEAD = struct.Struct("<BBff")
"""Version, cells along a side, half width (m), radius (m, 0 for none)."""

_VERSION = 1


def pack(surface: SurfaceMap) -> bytes:
    """From a measured map."""
    import numpy as np

    radius = surface.radius or 0.5 * (surface.x[-1] - surface.x[0] + surface.cell)
    middles = (np.arange(SIDE) + 0.5) / SIDE * 2.0 * radius - radius
    x, y = np.meshgrid(middles, middles)
    places = np.stack([x, y], axis=-1)
    inside = np.hypot(x, y) <= radius
    rows, columns = surface.cells(places)
    heights = np.where(inside, surface.height(places), np.nan)
    return packed(
        heights, np.where(inside, surface.std[rows, columns], np.nan), surface.kinds[rows, columns], float(radius)
    )


def packed(heights: NDArray[np.float64], std: NDArray[np.float64], kinds: NDArray[np.uint8], radius: float) -> bytes:
    """From (32, 32) heights and deviations, m, NaN for none, and kinds."""
    import numpy as np

    def millimetres(values: NDArray[np.float64]) -> bytes:
        whole = np.nan_to_num(np.clip(np.rint(1e3 * values), 0, NONE - 1), nan=NONE)
        return bytes(whole.astype("<u2").tobytes())

    head = _HEAD.pack(_VERSION, SIDE, radius, radius)
    return zlib.compress(head + millimetres(heights) + millimetres(std) + kinds.astype(np.uint8).tobytes(), 6)


def unpacked(blob: bytes) -> dict[str, Any]:
    """Plain data: ``side``, ``half_width_m``, rows of ``heights_m`` and ``std_m`` (None for none), ``seen``."""
    data = zlib.decompress(blob)
    _, side, half, radius = _HEAD.unpack_from(data)
    cells = side * side
    values = struct.unpack_from(f"<{2 * cells}H", data, _HEAD.size)
    kinds = data[_HEAD.size + 4 * cells :]

    def rows(numbers: Any) -> list[list[Any]]:
        return [list(numbers[k * side : (k + 1) * side]) for k in range(side)]

    lengths = [None if value == NONE else value / 1000.0 for value in values]
    return {
        "side": side,
        "half_width_m": half,
        "radius_m": radius or None,
        "heights_m": rows(lengths[:cells]),
        "std_m": rows(lengths[cells:]),
        "seen": rows([kind in (1, 2) for kind in kinds]),
    }

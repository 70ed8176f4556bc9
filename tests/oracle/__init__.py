"""An independent oracle: depth frames of silos by sphere tracing in NumPy, with exact truth.

Nothing here is shared with the Rust simulator or with the product. Solids are bounds of the distance to them (`solids`,
`walls`, `bottoms`, `feed`, `clutter`, `others`), rays find them by safe steps (`tracing`), a camera has true and told
intrinsics (`cameras`), a sensor has its errors (`sensors`), a scene joins them (`scenes`), volumes are integrals
(`volumes`). Populations are drawn by kind and seed (`drawing`, `silos`, `seen`, `no_silos`, `kinds`, `sequences`),
kept in a folder (`store`), and answers are judged (`judging`). `python -m benchmarks.populations` is the judge's table.

Frame and units: the silo frame of the contract, x and y level, z down, the camera at (t_x, t_y, 0); metres and radians.
"""

from .cameras import Intrinsics, Pose
from .kinds import KINDS, draw
from .no_silos import NO_SILO
from .scenes import Scene, Shot, Vessel

__all__ = ["KINDS", "NO_SILO", "Intrinsics", "Pose", "Scene", "Shot", "Vessel", "draw"]

"""Synthetic silos with exact truth (section 2.4): the walls, the feed, the sensor, and the frames it takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.camera import Camera
from siloscope.errors import UsageError
from siloscope.estimate import Ratios, SiloGeometry
from siloscope.frame import Frame
from siloscope.paper import metrics
from siloscope.pose import SiloPose

ASTRA = Camera(width=640, height=480, fx=570.3, fy=570.3, cx=319.5, cy=239.5)
"""The Orbbec Astra as the reconstructed scenarios use it."""

BASES = ("gaussian", "funnel", "mound", "flat")
"""Feed shapes that stand alone."""

EXTRAS = ("tilted", "lumpy", "rathole")
"""What can be added to a feed shape."""

Checked = TypeVar("Checked")


def _checked(check: Callable[..., Checked], *arguments: Any) -> Checked:
    """Runs a core function; its refusal becomes a `UsageError`."""
    try:
        return check(*arguments)
    except (ValueError, TypeError, OverflowError) as error:
        raise UsageError(str(error)) from None


@dataclass(frozen=True)
class Silo:
    """A cylinder on a cone, in metres. The silo frame's z points down and is 0 at the camera's height."""

    radius: float
    cylinder_height: float
    cone_height: float
    """Height from the cylinder's bottom to the cone's vertex, which an outlet may have cut away."""
    outlet_radius: float = 0.0
    """Radius of the outlet pipe; 0 for a cone that ends in its vertex."""
    top: float = 0.0
    """z of the cylinder's upper edge: 0 for a camera at the edge, negative for one that hangs below it."""
    outlet_length: float = 0.3
    """How far the outlet pipe reaches below the vertex, to its closed end."""
    outlet_offset: tuple[float, float] = (0.0, 0.0)
    """Offset of the outlet pipe from the axis."""
    roof: bool = False
    """Whether a flat roof covers the upper edge."""

    def __post_init__(self) -> None:
        _checked(_core.check_silo, self)

    @property
    def height(self) -> float:
        """Height of cylinder and cone together."""
        return self.cylinder_height + self.cone_height

    @property
    def capacity(self) -> float:
        """Volume of cylinder and cone down to the vertex, m³, without the outlet pipe."""
        return math.pi * self.radius**2 * (self.cylinder_height + self.cone_height / 3.0)

    @property
    def geometry(self) -> SiloGeometry:
        """The silo as estimates describe it."""
        bottom = self.top + self.cylinder_height
        return SiloGeometry(self.radius, bottom, bottom + self.cone_height)

    def feed_heights(self, feed: Feed | None, places: ArrayLike) -> NDArray[np.float64]:
        """Height of the feed surface over the vertex at places (..., 2) of the silo frame's x and y.

        NaN outside the silo and where the cone is bare.
        """
        xy = np.asarray(places, np.float64)
        heights: NDArray[np.float64] = _checked(_core.feed_heights, self, feed, xy.reshape(-1, 2))
        return heights.reshape(xy.shape[:-1])


@dataclass(frozen=True)
class Feed:
    """Feed in the silo. Lengths in metres, angles in radians; None takes the default for the silo's radius R.

    Parameters
    ----------
    shape : str
        A base (`BASES`) and any `EXTRAS`, joined by "+": "gaussian" is the paper's (section 2.4.1), "funnel" an
        inverted cone, "mound" an upright one; "tilted", "lumpy" and "rathole" alone stand on a flat base.
    level : float
        Height of the highest feed point over the vertex as a share of cylinder and cone height.
    angle, tip : float
        Angle of repose of funnel and mound (0.45) and the radius over which their tip is rounded (0.1 R).
    centre : pair of float
        Where funnel, mound or Gaussian have their axis.
    tilt, tilt_azimuth : float
        Slope of the whole surface (0.15 where "tilted") and the direction in which it rises.
    lump_height, lump_size : float
        Bound of the smooth random bumps (0.08 R where "lumpy") and the distance between them (0.35 R).
    rathole_radius, rathole_depth, rathole_centre
        A steep hole (0.2 R, 0.8 R, (0.35 R, 0.2 R) where "rathole").
    seed : int
        Draws the bumps.
    """

    shape: str = "gaussian"
    level: float = 0.1
    angle: float | None = None
    tip: float | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    tilt: float | None = None
    tilt_azimuth: float = 0.0
    lump_height: float | None = None
    lump_size: float | None = None
    rathole_radius: float | None = None
    rathole_depth: float | None = None
    rathole_centre: tuple[float, float] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        parts = self.parts
        unknown = [part for part in parts if part not in BASES + EXTRAS]
        bases = [part for part in parts if part in BASES]
        if unknown or len(bases) > 1 or len(set(parts)) < len(parts):
            known = ", ".join(BASES)
            raise UsageError(
                f"feed shape '{self.shape}': give one of {known}, with any of {', '.join(EXTRAS)} after '+'"
            )

    @property
    def parts(self) -> list[str]:
        """The names in `shape`."""
        return [part.strip() for part in self.shape.split("+")]

    def resolved(self, radius: float) -> ResolvedFeed:
        """All numbers for a silo of this radius."""
        parts = self.parts

        def chosen(value: float | None, part: str, default: float) -> float:
            return (default if part in parts else 0.0) if value is None else value

        def given(value: float | None, default: float) -> float:
            return default if value is None else value

        return ResolvedFeed(
            base=next((part for part in parts if part in BASES), "flat"),
            level=self.level,
            angle=given(self.angle, 0.45),
            tip=given(self.tip, 0.1 * radius),
            centre=self.centre,
            tilt=chosen(self.tilt, "tilted", 0.15),
            tilt_azimuth=self.tilt_azimuth,
            lump_height=chosen(self.lump_height, "lumpy", 0.08 * radius),
            lump_size=given(self.lump_size, 0.35 * radius),
            rathole_radius=given(self.rathole_radius, 0.2 * radius),
            rathole_depth=chosen(self.rathole_depth, "rathole", 0.8 * radius),
            rathole_centre=(0.35 * radius, 0.2 * radius) if self.rathole_centre is None else self.rathole_centre,
            seed=self.seed,
        )


@dataclass(frozen=True)
class ResolvedFeed:
    """A `Feed` with no default left open; see there."""

    base: str
    level: float
    angle: float
    tip: float
    centre: tuple[float, float]
    tilt: float
    tilt_azimuth: float
    lump_height: float
    lump_size: float
    rathole_radius: float
    rathole_depth: float
    rathole_centre: tuple[float, float]
    seed: int


@dataclass(frozen=True)
class SensorModel:
    """What a sensor makes of exact depths (Eq. 10). Metres and radians.

    A reading is ``true + bias(true) + sigma(true)·normal``, cut to the range and rounded to `unit`.
    The default is a perfect sensor.
    """

    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Bias ``b0 + b1 d + b2 d²`` at the true depth d (Eq. 8)."""
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard deviation ``n0 + n1 d + n2 d²`` (Eq. 9), to which the power law is added."""
    noise_scale: float = 0.0
    """Power law ``scale · d**power``; for stereo ``s/(fx·B)`` and 2."""
    noise_power: float = 2.0
    """Its exponent."""
    noise_floor: float = 0.0
    """Least standard deviation."""
    incidence_gain: float = 0.0
    """The standard deviation grows by ``1 + gain·(θ/(π/2 - θ))²`` at incidence angle θ."""
    correlation: float = 0.0
    """Share of the noise's variance that neighbouring pixels have in common."""
    correlation_length: float = 8.0
    """Reach of the common part in pixels."""
    min_range: float = 0.0
    """Nearest depth measured."""
    max_range: float = math.inf
    """Farthest depth measured."""
    max_incidence: float = math.pi / 2
    """Surfaces met at a larger angle to their normal give no measurement."""
    dropout: float = 0.0
    """Share of pixels lost for no visible reason."""
    flying: float = 0.0
    """Share of pixels at depth edges that read a depth between the two sides."""
    flying_step: float = 0.03
    """Relative depth step that makes an edge."""
    dust: float = 0.0
    """Share of pixels that read a dust grain before the surface."""
    unit: float = 0.0
    """Metres a raw unit, 0 for unrounded depths; readings beyond 65534 units are lost."""

    def __post_init__(self) -> None:
        _checked(_core.check_sensor, self)

    @property
    def perfect(self) -> bool:
        """Whether it leaves exact depths as they are."""
        return self == SensorModel()

    def bias_at(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Mean error at true depths, metres (Eq. 8)."""
        return self._laws(depth)[0]

    def sigma_at(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Standard deviation at true depths and perpendicular incidence, metres (Eq. 9)."""
        return self._laws(depth)[1]

    def _laws(self, depth: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        d = np.asarray(depth, np.float64)
        bias, sigma = _core.sensor_laws(self, d.ravel())
        return bias.reshape(d.shape), sigma.reshape(d.shape)


PERFECT = SensorModel()
"""Exact depths (section 2.4.1)."""

ASTRA_S = SensorModel(
    bias=(3.4397e-3, -0.017878, 2.2093e-2),
    noise=(0.5e-3 / math.sqrt(12.0), -5e-4 / math.sqrt(12.0), 3e-3 / math.sqrt(12.0)),
)
"""Orbbec Astra S: Eqs. 8 and 9, which are in millimetres, for metres."""


@dataclass(frozen=True)
class Scene:
    """A silo, what is in it, and the camera that looks at it.

    The camera sits at (t_x, t_y, 0) of the silo frame and looks as `pose` says.
    """

    silo: Silo
    pose: SiloPose
    camera: Camera = ASTRA
    feed: Feed | None = field(default_factory=Feed)
    sensor: SensorModel = PERFECT
    seed: int = 0
    """Draws the sensor's noise."""

    def render(self, threads: int = 1) -> SimulatedFrame:
        """Casts every pixel's ray and measures it. The result does not depend on the number of threads.

        Raises
        ------
        UsageError
            Where a number is outside its bounds, or the camera is buried in feed or outside the silo.
        """
        shape = (self.camera.height, self.camera.width)
        depth, labels, normals = _checked(_core.render_scene, self, threads)
        if self.sensor.perfect:
            measured, false_returns = depth.copy(), np.zeros(depth.shape, np.bool_)
        else:
            parts = (self.sensor, self.camera, depth, labels, normals, self.seed, threads)
            measured, false_returns = _checked(_core.measure_depth, *parts)
        return SimulatedFrame(
            scene=self,
            depth=depth.reshape(shape),
            labels=labels.reshape(shape),
            normals=normals.reshape(*shape, 3),
            measured=measured.reshape(shape),
            false_returns=false_returns.reshape(shape),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data with the fields' names."""
        return {
            "silo": asdict(self.silo),
            "pose": asdict(self.pose),
            "camera": self.camera.to_dict(),
            "feed": None if self.feed is None else asdict(self.feed),
            "sensor": {name: _plain(value) for name, value in asdict(self.sensor).items()},
            "seed": self.seed,
        }


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isinf(value) else value


@dataclass(frozen=True)
class Content:
    """The feed's truth, by quadrature (relative error below 1e-6). Heights are over the cone's vertex, metres.

    Only feed inside cylinder and cone counts; feed in the outlet pipe or stuck to walls does not.
    """

    volume: float
    """m³."""
    area: float
    """Area of the feed surface seen from above, m²."""
    mean_height: float | None
    """Mean height of the surface by area seen from above; None where there is no feed."""
    max_height: float | None
    """Highest feed point."""
    min_height: float | None
    """Lowest point of the surface."""

    def to_dict(self) -> dict[str, float | None]:
        """Plain data."""
        return asdict(self)


EMPTY = Content(volume=0.0, area=0.0, mean_height=None, max_height=None, min_height=None)
"""No feed at all."""


def content_of(silo: Silo, feed: Feed | None) -> Content:
    """Volume and heights of a feed in its silo."""
    sums = _checked(_core.feed_content, silo, feed)
    if sums is None or sums[1] == 0.0:
        return EMPTY
    return Content(*sums)


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """A frame with its truth. Arrays are (H, W); metres, camera frame.

    Attributes
    ----------
    depth : float64
        Exact depth z, 0 where nothing is hit.
    labels : uint8
        What each pixel shows (`siloscope.paper.metrics.LABELS`).
    normals : float64 (H, W, 3)
        Unit normals towards the camera; 0 where nothing is hit.
    measured : float64
        Depth after the sensor model, 0 where there is no measurement.
    false_returns : bool
        Pixels that show dust or fly between two surfaces.
    """

    scene: Scene
    depth: NDArray[np.float64]
    labels: NDArray[np.uint8]
    normals: NDArray[np.float64]
    measured: NDArray[np.float64]
    false_returns: NDArray[np.bool_]

    @property
    def pose(self) -> SiloPose:
        """The true pose."""
        return self.scene.pose

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.scene.camera

    @property
    def measured_labels(self) -> NDArray[np.uint8]:
        """Labels of what was measured: 0 where nothing was, 4 for false returns."""
        labels = np.where(self.false_returns, np.uint8(metrics.LABELS["other"]), self.labels)
        return np.where(self.measured > 0, labels, np.uint8(0))

    @cached_property
    def content(self) -> Content:
        """The feed's volume and heights."""
        return content_of(self.scene.silo, self.scene.feed)

    @property
    def true_volume(self) -> float:
        """Feed inside cylinder and cone, m³."""
        return self.content.volume

    @property
    def fill_fraction(self) -> float:
        """Feed volume as a share of the silo's capacity."""
        return self.true_volume / self.scene.silo.capacity

    @property
    def pixel_ratios(self) -> Ratios:
        """Shares of cylinder, cone and feed among the pixels with depth (section 2.4.4)."""
        return metrics.pixel_ratios(self.measured_labels)

    @property
    def area_ratios(self) -> Ratios:
        """The same shares by true surface area."""
        return metrics.area_ratios(self.measured_labels, self.depth, self.normals, self.camera)

    def raw(self, unit: float | None = None) -> NDArray[np.uint16]:
        """Measured depth in raw units of `unit` metres (default: the sensor's, else 1 mm); 0 where there is none."""
        metres = unit or self.scene.sensor.unit or 1e-3
        counts = np.rint(self.measured / metres)
        return np.where(counts < 65535, counts, 0).astype(np.uint16)

    def frame(self) -> Frame:
        """The measured depth as a `Frame` in metres."""
        return Frame(depth=self.measured, camera=self.camera, source="simulated frame")

    def truth(self) -> dict[str, Any]:
        """Plain data: pose, geometry, content and ratios."""
        scene = self.scene
        return {
            **asdict(scene.pose),
            "T_silo_camera": scene.pose.T_silo_camera.tolist(),
            "silo": scene.silo.geometry.to_dict(),
            "feed": None if scene.feed is None else asdict(scene.feed),
            "seed": scene.seed,
            "content": self.content.to_dict(),
            "volume_m3": self.true_volume,
            "capacity_m3": scene.silo.capacity,
            "fill_fraction": self.fill_fraction,
            "ratios": {"pixels": self.pixel_ratios.to_dict(), "area": self.area_ratios.to_dict()},
        }


def discharge(scene: Scene, steps: int, highest: float = 0.9, lowest: float = 0.0) -> Iterator[Scene]:
    """Scenes of a discharge (section 2.4.1): the feed level falls evenly from `highest` to `lowest` in `steps` steps.

    Every scene draws its own noise.
    """
    if steps < 1 or scene.feed is None:
        raise UsageError("a discharge needs feed and at least 1 step")
    for step, level in enumerate(np.linspace(highest, lowest, steps)):
        feed = replace(scene.feed, level=float(level))
        yield replace(scene, feed=feed, seed=(scene.seed * 1_000_003 + step) % 2**64)

"""The frames of the regression check: name of a case, and the call that gives its results.

A case is a `functools.partial` of a function of this module, so that another process can run it. All that it uses of
the package is imported here, and is public.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import siloscope
from siloscope import Camera, Frame, sensors
from siloscope.reproduction.challenges import complex_feed, feeds
from siloscope.reproduction.discharges import perfect, perturbed, real
from siloscope.reproduction.sensor_trials import accelerometer
from siloscope.simulation import ALL, ASTRA_S, PERFECT, Feed, Scene, Silo, defects
from siloscope.simulation.metrics import LABELS
from siloscope.simulation.scenarios import SCENARIOS, random_big_scene, random_scene, scenario
from siloscope.simulation.stand_ins import FOUR_SENSORS

REALDATA = Path(os.environ.get("SILOSCOPE_REALDATA", Path(__file__).parents[2].parent / "shared" / "realdata"))
"""Recordings by others; not part of the project."""

SENSOR = "orbbec-astra-s"
LIDAR = sensors.SensorProfile("lidar-like", noise=(0.0, 0.01, 0.0, 0.0, 0.0, 2.0))

Results = dict[str, Any]
"""What a case gives, by name: an Estimate, a Calibration, a Content, a Track, an array or a number."""

Case = Callable[[], Results]


def halved(camera: Camera) -> Camera:
    """The camera with half as many rows and columns; pixel centres at integers."""
    cx, cy = (camera.cx - 0.5) / 2, (camera.cy - 0.5) / 2
    width, height = camera.width // 2, camera.height // 2
    return replace(camera, width=width, height=height, fx=camera.fx / 2, fy=camera.fy / 2, cx=cx, cy=cy)


def small(scene: Scene) -> Scene:
    """The scene seen by the halved camera."""
    return replace(scene, camera=halved(scene.camera))


def located(scene: Scene, **calls: dict[str, Any]) -> Results:
    """The answers of `locate` for one simulated frame, by the name of the call."""
    frame = scene.render().frame()
    return {name: siloscope.locate(frame, **settings) for name, settings in calls.items()}


# ---- locate: the paper's scenarios -----------------------------------------------------------------------------------

SHAPE_TENSOR = {"method": "shape-tensor"}
STEPS = 12
"""Steps of each discharge."""


def paper_perfect(silo: int, step: int) -> Results:
    """Table 3."""
    discharge = perfect()[silo]
    scene = small(discharge.trials(STEPS)[step].scene)
    return located(scene, surface={"sensor": discharge.profile}, shape_tensor=SHAPE_TENSOR)


def paper_perturbed(silo: int, step: int) -> Results:
    """Table 4, with more and with less that is known."""
    scene = small(perturbed()[silo].trials(STEPS)[step].scene)
    diameter = {"diameter": 2.0 * scene.silo.radius}
    return located(scene, sensor={"sensor": SENSOR}, diameter=diameter, nothing={}, shape_tensor=SHAPE_TENSOR)


def paper_real(silo: int, step: int) -> Results:
    """Table 5, stand-ins."""
    discharge = real()[silo]
    return located(small(discharge.trials(8)[step].scene), surface={"sensor": discharge.profile}, nothing={})


def paper_scenario(name: str) -> Results:
    """A named scene at full size; the ones without a silo must be refused."""
    return located(scenario(name), surface={"sensor": SENSOR}, shape_tensor=SHAPE_TENSOR)


def feed_shape(shape: str, number: int) -> Results:
    """Section 3.6: feed shapes."""
    trial = complex_feed(shape)[number]
    return located(small(trial.scene), surface={"sensor": trial.profile})


def four_sensors(kind: int, device: int) -> Results:
    """Section 2.4.5, with and without gravity."""
    mounted = FOUR_SENSORS[kind]
    scene = small(mounted.scene(device))
    told = {"sensor": mounted.profile, "gravity": accelerometer(scene.pose, device)}
    return located(scene, surface={"sensor": mounted.profile}, gravity=told)


# ---- locate: silos nobody has seen -----------------------------------------------------------------------------------

FEEDS = ("gaussian", "funnel", "mound", "flat", "tilted", "lumpy", "rathole", "funnel+lumpy+tilted")


def unseen(seed: int) -> Results:
    """A random silo with a random feed."""
    draw = np.random.default_rng((seed, 16))
    feed = Feed(FEEDS[seed % len(FEEDS)], float(0.7 * draw.uniform() ** 2), seed=seed)
    scene = small(random_scene(seed, feed, sensor=PERFECT if seed % 5 == 0 else ASTRA_S, miss=0.12))
    calls: dict[str, dict[str, Any]] = {"sensor": {"sensor": SENSOR}}
    if seed % 2:
        calls["nothing"] = {}
    if seed % 3 == 0:
        calls["shape_tensor"] = SHAPE_TENSOR
    return located(scene, **calls)


def unseen_defects(name: str, seed: int) -> Results:
    """A random silo with a defect of its wall or things in view."""
    feed = Feed(FEEDS[seed % len(FEEDS)], 0.25, seed=seed)
    scene = small(random_scene(seed, feed, sensor=ASTRA_S))
    scene = replace(scene, defects=defects(name, seed))
    return located(scene, sensor={"sensor": SENSOR}, diameter={"diameter": 2.0 * scene.silo.radius})


def large(seed: int) -> Results:
    """A silo of industrial size."""
    scene = small(random_big_scene(seed, Feed(FEEDS[seed % len(FEEDS)], 0.05 * (seed % 12))))
    return located(scene, surface={"sensor": LIDAR}, nothing={})


def outlet(seed: int) -> Results:
    """A roof and an outlet pipe beside the axis."""
    scene = small(random_scene(seed, Feed(level=0.02), sensor=ASTRA_S))
    silo = replace(scene.silo, outlet_radius=0.15, outlet_offset=(0.05 * (seed % 4), 0.0))
    return located(replace(scene, silo=silo), surface={"sensor": SENSOR})


# ---- locate: ways to give a frame and what is known ------------------------------------------------------------------


def cloud(seed: int) -> Results:
    """Points, as a list and as an image, of both precisions, in a box."""
    scene = small(random_scene(seed, Feed(level=0.15), sensor=ASTRA_S))
    depth = scene.render().measured[..., None]
    points = np.concatenate([scene.camera.rays() * depth, depth], axis=-1)
    listed = points.reshape(-1, 3)[points.reshape(-1, 3)[:, 2] > 0]
    few = listed[::3].astype(np.float32)
    box = (*np.quantile(listed, (0.02, 0.98), axis=0).T.ravel().tolist(),)
    return {
        "organised": siloscope.locate(np.where(depth > 0, points, np.nan)),
        "few": siloscope.locate(few, diameter=2.0 * scene.silo.radius),
        "cropped": siloscope.locate(listed, crop=box),
        "grid": siloscope.locate(few, grid=0.08),
        "shape_tensor": siloscope.locate(few, method="shape-tensor", neighbours=20),
    }


def inputs(seed: int) -> Results:
    """Raw units, a mask, a distorted camera, gravity, a warm start, and the labels."""
    scene = small(random_scene(seed, Feed(level=0.2), sensor=ASTRA_S))
    bent = replace(scene.camera, distortion_model="brown_conrady", distortion=(-0.08, 0.03, 0.001, -0.0005, 0.0))
    frame = scene.render()
    other = replace(scene, seed=seed + 1, feed=Feed("mound", 0.3)).render().frame()
    mask = np.zeros(frame.measured.shape, np.bool_)
    mask[20:-20, 30:-10] = True
    first = siloscope.locate(frame.frame(), sensor=SENSOR)
    told: dict[str, Any] = {"sensor": SENSOR, "gravity": 9.81 * scene.pose.axis_direction, "threads": 2}
    return {
        "raw": siloscope.locate(frame.raw(0.001), scene.camera, depth_unit=0.001, sensor=SENSOR),
        "mask": siloscope.locate(frame.frame(), sensor=SENSOR, mask=mask),
        "distorted": siloscope.locate(replace(scene, camera=bent).render().frame(), sensor=SENSOR),
        "gravity": siloscope.locate(frame.frame(), **told),
        "warm_start": siloscope.locate(other, sensor=SENSOR, start=first if first.ok else None, ratios=False),
        "labels": None if first.details is None else first.details.labels,
        "points": None if first.details is None else first.details.points,
        "residuals": None if first.details is None else first.details.residuals,
    }


# ---- calibrate -------------------------------------------------------------------------------------------------------

LENGTH = 20
"""Frames of a sequence."""


def sequence(scene: Scene, highest: float = 0.75, count: int = LENGTH) -> list[Frame]:
    """Frames of a discharge."""
    levels = np.linspace(highest, 0.05, count)
    scenes = [
        replace(scene, feed=Feed(FEEDS[i % 4], float(level), seed=i), seed=scene.seed + i)
        for i, level in enumerate(levels)
    ]
    return [replace(each.render().frame(), timestamp=600.0 * i) for i, each in enumerate(scenes)]


def calibrated_paper(number: int) -> Results:
    """The paper's silo, by both rules."""
    scene = small(perturbed()[number].scene)
    taken = sequence(scene)
    return {
        "information": siloscope.calibrate(taken, sensor=SENSOR),
        "mean": siloscope.calibrate(taken, sensor=SENSOR, rule="mean-of-last-10"),
    }


def calibrated_unseen(seed: int) -> Results:
    """A random silo with less and less known."""
    scene = small(random_scene(seed, sensor=ASTRA_S))
    taken = sequence(scene)
    return {
        "sensor": siloscope.calibrate(taken, sensor=SENSOR, gravity=scene.pose.axis_direction),
        "diameter": siloscope.calibrate(taken, diameter=2.0 * scene.silo.radius),
        "nothing": siloscope.calibrate(taken, jobs=2),
    }


def calibrated_moved(seed: int) -> Results:
    """The camera is moved in the middle; then the calibration goes on."""
    scene = small(random_scene(seed, sensor=ASTRA_S))
    pose = scene.pose
    moved = replace(scene, pose=replace(pose, r_x=pose.r_x + 0.02, t_y=pose.t_y + 0.03), seed=seed + 500)
    before, after = sequence(scene, count=10), sequence(moved, count=10)
    first = siloscope.calibrate(before, sensor=SENSOR)
    return {
        "whole": siloscope.calibrate([*before, *after], sensor=SENSOR),
        "first": first,
        "continued": siloscope.calibrate(after, continue_from=first),
    }


def calibrated_worn(seed: int) -> Results:
    """A silo with all defects, from its estimates, one of them of another silo."""
    scene = replace(small(random_scene(seed, sensor=ASTRA_S)), defects=defects("oval+dents+film+ladder", seed))
    wrong = sequence(small(random_scene(seed + 1, sensor=ASTRA_S)), count=1)
    estimates = [siloscope.locate(frame, sensor=SENSOR) for frame in [*sequence(scene, count=LENGTH - 1), *wrong]]
    return {"estimates": siloscope.calibrate(estimates)}


# ---- measure and track -----------------------------------------------------------------------------------------------


def contents(seed: int) -> Results:
    """A silo calibrated from an earlier discharge, then feed of every shape."""
    scene = small(random_scene(seed, sensor=ASTRA_S))
    silo = siloscope.calibrate(sequence(scene, 0.7, 5), sensor=SENSOR, bottom="cone")
    found: Results = {"calibration": silo}
    if not silo.ok:
        return found
    for number, shape in enumerate(FEEDS[:6]):
        feed = Feed(shape, 0.8 - 0.13 * number, angle=0.4, seed=seed)
        frame = replace(scene, feed=feed, seed=seed + 100 + number).render().frame()
        settings: dict[str, Any] = {"density": 650.0, "density_std": 30.0} if number % 2 else {"product": "wheat"}
        found[shape] = siloscope.measure(frame, silo, **settings)
        found[f"{shape}_surface"] = found[shape].surface and found[shape].surface.heights
    return found


def content_alone(seed: int) -> Results:
    """Measured without a calibration, and with a datasheet."""
    scene = small(random_scene(seed, Feed("funnel", 0.2), sensor=ASTRA_S))
    frame, silo = scene.render().frame(), scene.silo
    sheet: dict[str, Any] = {"diameter": 2 * silo.radius, "cylinder": silo.cylinder_height, "cone": silo.cone_height}
    return {
        "alone": siloscope.measure(frame, sensor=SENSOR),
        "datasheet": siloscope.measure(frame, sensor=SENSOR, top=silo.top, outlet_diameter=0.3, **sheet),
    }


def heap(seed: int) -> Results:
    """The surface of a bare cloud, and the volume between two of them."""
    maps = []
    for level in (0.25, 0.4):
        scene = small(random_scene(seed, Feed("mound", level, seed=seed), sensor=ASTRA_S))
        frame = scene.render()
        depth = frame.measured[frame.labels == LABELS["feed"]]
        points = np.column_stack([scene.camera.rays()[frame.labels == LABELS["feed"]] * depth[:, None], depth])
        maps.append(siloscope.surface_map(points[depth > 0], up=-scene.pose.axis_direction, noise=0.005))
    found: Results = {f"heights {number}": surface.heights for number, surface in enumerate(maps)}
    return {**found, "shape": maps[1].shape, "volume": siloscope.volume_between(*maps)}


def refused(seed: int) -> Results:
    """No calibration: frames without a silo, and frames of several silos."""
    walls = [replace(scenario("flat-wall"), seed=seed + i).render().frame() for i in range(3)]
    others = [small(random_scene(seed + i, Feed(level=0.1), sensor=ASTRA_S)).render().frame() for i in range(4)]
    return {
        "none": siloscope.calibrate(walls, sensor=SENSOR),
        "disagree": siloscope.calibrate(others, sensor=SENSOR),
    }


def story(seed: int) -> Results:
    """A discharge, a refill and another discharge."""
    scene = small(random_scene(seed, sensor=ASTRA_S))
    silo = siloscope.calibrate(sequence(scene, 0.6, 6), sensor=SENSOR, bottom="cone")
    levels = (0.5, 0.45, 0.38, 0.38, 0.31, 0.7, 0.7, 0.62, 0.55, 0.55, 0.47, 0.4)
    scenes = [replace(scene, feed=Feed("funnel", level), seed=seed + i) for i, level in enumerate(levels)]
    taken = [replace(s.render().frame(), timestamp=1.7e9 + 21_600.0 * i) for i, s in enumerate(scenes)]
    return {"calibration": silo, "track": siloscope.track(taken, silo, density=700.0)}


# ---- recordings by others --------------------------------------------------------------------------------------------

RECORDINGS: dict[str, dict[str, Any]] = {
    "mosd_kinect_cylindric/learn33.pcd": {},
    "mosd_kinect_cylindric/learn34.pcd": {},
    "mosd_kinect_cylindric/learn36.pcd": {},
    "mosd_kinect_cylindric/learn44.pcd": {},
    "pcl_mug_cylinder/table_scene_mug_stereo_textured.pcd": {},
    "primitives_kinect_xyz/sample.xyz": {},
    "tank_total_station/scan.csv": {},
    "bin_content_livox/deep_bin_overhead.pcd": {},
    "bin_content_livox/last_overhead_concave.pcd": {},
    "ball_series_livox/deep_50_balls.pcd": {},
    "azure_kinect_mkv_mug/recording.mkv": {},
    "realsense_bag_d435/single_depth_color_640x480.bag": {"sensor": "realsense-d435"},
    "rosbag1_pointcloud2_can/perception_tutorial.bag": {},
    "formats_las_e57/bunnyFloat.e57": {},
}
"""File and settings of `locate`."""


def recording(name: str, method: str) -> Results:
    """The first frame of a recording, or the error that it is answered with."""
    try:
        with siloscope.open(REALDATA / name) as source:
            frame = next(iter(source))
        return {"estimate": siloscope.locate(frame, method=method, **RECORDINGS[name])}
    except siloscope.SiloscopeError as error:
        return {"error": type(error).__name__}


def recorded() -> Iterator[tuple[str, Case]]:
    """The recordings that are there."""
    for name in RECORDINGS:
        if (REALDATA / name).exists():
            for method in ("surface", "shape-tensor"):
                yield f"recordings/{name}/{method}", partial(recording, name, method)


# ---- all of them -----------------------------------------------------------------------------------------------------


def _each(name: str, work: Callable[..., Results], *ranges: Sequence[Any]) -> Iterator[tuple[str, Case]]:
    """A case for every combination."""
    for chosen in np.ndindex(*(len(values) for values in ranges)):
        given = [values[i] for values, i in zip(ranges, chosen, strict=True)]
        yield "/".join([name, *map(str, given)]), partial(work, *given)


def cases() -> dict[str, Case]:
    """All cases by name, the long ones first."""
    return dict(
        [
            *_each("calibrate/unseen", calibrated_unseen, range(300, 304)),
            *_each("calibrate/paper", calibrated_paper, range(3)),
            *_each("calibrate/moved", calibrated_moved, range(310, 313)),
            *_each("calibrate/worn", calibrated_worn, range(320, 322)),
            *_each("track", story, range(400, 402)),
            *_each("content/shapes", contents, range(410, 418)),
            *recorded(),
            *_each("paper/scenario", paper_scenario, [name for name in SCENARIOS if not name.startswith("big")]),
            *_each("content/alone", content_alone, range(420, 426)),
            *_each("content/heap", heap, range(430, 434)),
            *_each("calibrate/refused", refused, range(330, 333)),
            *_each("input/cloud", cloud, range(500, 512)),
            *_each("input/image", inputs, range(520, 530)),
            *_each("large", large, range(600, 620)),
            *_each("paper/perfect", paper_perfect, range(3), range(STEPS)),
            *_each("paper/perturbed", paper_perturbed, range(3), range(STEPS)),
            *_each("paper/real", paper_real, range(4), range(8)),
            *_each("paper/feed", feed_shape, list(feeds(Silo(1.0, 1.0, 1.0))), range(6)),
            *_each("paper/sensors", four_sensors, range(4), range(1, 4)),
            *_each("unseen/defects", unseen_defects, [*ALL, "all"], range(200, 204)),
            *_each("unseen/outlet", outlet, range(220, 228)),
            *_each("unseen/random", unseen, range(100)),
        ]
    )

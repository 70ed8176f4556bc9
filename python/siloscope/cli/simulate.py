"""``siloscope simulate``: frames of a silo that exists only on paper, with their exact truth."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from siloscope import __version__
from siloscope.cli.outcome import print_json, writing
from siloscope.cli.progress import say, track
from siloscope.errors import UsageError
from siloscope.io import camera_files, writers
from siloscope.schema import vessel as vessels
from siloscope.schema.vessel import VesselFile
from siloscope.simulation import DEFECTS, Feed, Scene, SimulatedFrame, defects, discharge, sensor_model, true_camera
from siloscope.simulation.scenarios import SCENARIOS, looking_at, scenario
from siloscope.simulation.vessels import defects_of, silo_of, ullage
from siloscope.types.camera import Camera
from siloscope.types.pose import SiloPose
from siloscope.wording import counted

MOST_STEPS = 100_000
"""Frames of one discharge."""

PERFECT_UNIT = 0.00025
"""Metres per raw unit where no sensor names one: fine for a perfect silo, and 16 bits still reach 16 m."""

_VESSEL = "Vessel file (TOML) in place of the scenario's silo: diameter, courses, bottom, outlet, roof, obstacles."
_INTRINSICS = "How well camera.json is known: exact, calibrated or nominal; the true camera is drawn and in truth.json."
_MULTIPATH = "Share of the light that surfaces throw back, for a ToF sensor: 0 to 1."
_SCENARIO = f"Silo, camera and pose to start from: {', '.join(SCENARIOS)}."
_FEED = "gaussian, funnel, mound or flat, with any of tilted, lumpy, rathole after '+'; none for empty."
_LEVEL = "Highest feed point as a share of the silo's height; of the first frame, with --steps."
_SENSOR = "perfect, astra-s (Eqs. 8-10), another profile's name, or a profile's TOML file."
_DEFECTS = f"Real walls and clutter, joined by commas: {', '.join(DEFECTS)}; or all."


def simulate(
    out: Annotated[Path, typer.Option(help="Folder to write into; made where it is missing, else it must be empty.")],
    scenario_name: Annotated[str, typer.Option("--scenario", help=_SCENARIO)] = "silo1",
    vessel_file: Annotated[Path | None, typer.Option("--vessel", help=_VESSEL)] = None,
    radius: Annotated[float | None, typer.Option(help="Radius of the cylinder, m.")] = None,
    cylinder: Annotated[float | None, typer.Option(help="Height of the cylinder, m.")] = None,
    cone: Annotated[float | None, typer.Option(help="Height of the cone, m.")] = None,
    outlet: Annotated[float | None, typer.Option(help="Radius of the outlet pipe, m.")] = None,
    outlet_offset: Annotated[str | None, typer.Option(help="Offset x,y of the outlet from the axis, m.")] = None,
    pose: Annotated[str | None, typer.Option(help="r_x,r_y,t_x,t_y in rad and m.")] = None,
    feed: Annotated[str | None, typer.Option(help=_FEED)] = None,
    level: Annotated[float | None, typer.Option(help=_LEVEL)] = None,
    steps: Annotated[int | None, typer.Option(help="Frames of a discharge, down to the empty silo.")] = None,
    sensor: Annotated[str | None, typer.Option(help=_SENSOR)] = None,
    device: Annotated[int | None, typer.Option(help="Draws one device's bias from the sensor's profile.")] = None,
    defect_names: Annotated[str | None, typer.Option("--defects", help=_DEFECTS)] = None,
    dust: Annotated[float | None, typer.Option(help="Share of pixels that read dust.")] = None,
    dropout: Annotated[float | None, typer.Option(help="Share of pixels without measurement.")] = None,
    flying: Annotated[float | None, typer.Option(help="Share of edge pixels that fly between two surfaces.")] = None,
    multipath: Annotated[float | None, typer.Option(help=_MULTIPATH)] = None,
    max_incidence: Annotated[float | None, typer.Option(help="Steepest incidence measured, degrees.")] = None,
    camera: Annotated[Path | None, typer.Option(help="Camera file: JSON, TOML, or ROS camera_info YAML.")] = None,
    width: Annotated[int | None, typer.Option(help="Image width; focal lengths scale with it.")] = None,
    height: Annotated[int | None, typer.Option(help="Image height.")] = None,
    fx: Annotated[float | None, typer.Option(help="Focal length, pixels.")] = None,
    fy: Annotated[float | None, typer.Option(help="Focal length, pixels.")] = None,
    cx: Annotated[float | None, typer.Option(help="Principal point, pixels.")] = None,
    cy: Annotated[float | None, typer.Option(help="Principal point, pixels.")] = None,
    known: Annotated[str, typer.Option("--intrinsics", help=_INTRINSICS)] = "exact",
    seed: Annotated[int, typer.Option(help="Draws noise, lumps, dents and cables.")] = 0,
    depth_unit: Annotated[float | None, typer.Option(help="Metres per raw unit of the PNG files.")] = None,
    exact: Annotated[bool, typer.Option("--exact", help="Write float64 metres (.npy) instead of 16-bit PNG.")] = False,
    labels: Annotated[bool, typer.Option("--labels", help="Also write what each pixel shows, as 8-bit PNG.")] = False,
    threads: Annotated[int, typer.Option(help="Threads.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print the truth as one JSON document.")] = False,
) -> None:
    """Write depth frames of a simulated silo, their camera, and the exact truth.

    [bold]Example:[/bold] siloscope simulate --scenario silo2 --sensor astra-s --steps 100 --out discharge

    The folder gets frame_0000.png and so on, camera.json (with the depth unit), and truth.json: pose, geometry, feed
    volume and ratios of every frame, with --vessel also the ullage. Labels are 0 none, 1 cylinder, 2 cone (any bottom),
    3 feed, 4 other.
    """
    scene = scenario(scenario_name)
    vessel = None if vessel_file is None else vessels.read(vessel_file)
    if vessel is not None:
        scene = _placed(scene, vessel)
    silo = _given(radius=radius, cylinder_height=cylinder, cone_height=cone, outlet_radius=outlet)
    if outlet_offset is not None:
        silo["outlet_offset"] = tuple(_numbers("--outlet-offset", outlet_offset, "x,y in metres", 2))
    scene = replace(scene, silo=replace(scene.silo, **silo), seed=seed)
    scene = replace(scene, pose=_pose(pose) if pose else scene.pose, feed=_feed(scene.feed, feed, level, seed))
    errors = _given(dust=dust, dropout=dropout, flying=flying, multipath=multipath)
    if max_incidence is not None:
        errors["max_incidence"] = math.radians(max_incidence)
    model = sensor_model(sensor, device) if sensor else scene.sensor
    scene = replace(scene, sensor=replace(model, **errors))
    scene = replace(scene, defects=defects(defect_names, seed) if defect_names else scene.defects)
    intrinsics = _given(fx=fx, fy=fy, cx=cx, cy=cy)
    told = _camera(scene.camera, camera, width, height, intrinsics)
    scene = replace(scene, camera=true_camera(told, known, seed), told=None if known == "exact" else told)
    scenes = _scenes(scene, steps, level)
    unit = None if exact else _unit(depth_unit, sensor)
    document = _write(scenes, out, unit, labels, threads, vessel)
    if as_json:
        print_json(document)
    else:
        say(f"{counted(len(scenes), 'frame')}, camera.json and truth.json in {out}")


def _given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _pose(text: str) -> SiloPose:
    return SiloPose(*_numbers("--pose", text, "r_x,r_y,t_x,t_y in radians and metres", 4))


def _numbers(option: str, text: str, meaning: str, count: int) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise UsageError(f"{option} '{text}': give {count} numbers {meaning}")
    return numbers


def _feed(current: Feed | None, shape: str | None, level: float | None, seed: int) -> Feed | None:
    if shape == "none":
        return None
    if current is None and shape is None and level is None:
        return None
    base = current or Feed()
    return replace(base, seed=seed, **_given(shape=shape, level=level))


def _camera(
    current: Camera, file: Path | None, width: int | None, height: int | None, intrinsics: dict[str, Any]
) -> Camera:
    """The camera of a file or the scenario, resized to what is asked for, with the intrinsics that are given."""
    camera = current if file is None else camera_files.load(file)
    width = camera.width if width is None else width
    height = camera.height if height is None else height
    across, down = width / camera.width, height / camera.height
    resized = replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * across,
        fy=camera.fy * down,
        cx=(camera.cx + 0.5) * across - 0.5,
        cy=(camera.cy + 0.5) * down - 0.5,
    )
    return replace(resized, **intrinsics)


def _scenes(scene: Scene, steps: int | None, level: float | None) -> list[Scene]:
    if steps is None:
        return [scene]
    if not 1 <= steps <= MOST_STEPS:
        raise UsageError(f"--steps must be between 1 and {MOST_STEPS}, got {steps}")
    return list(discharge(scene, steps, highest=0.9 if level is None else level))


def _unit(depth_unit: float | None, sensor: str | None) -> float:
    if depth_unit is not None:
        if not 1e-6 <= depth_unit <= 1.0:
            raise UsageError(f"--depth-unit must be between 0.000001 and 1 m, got {depth_unit}")
        return depth_unit
    return PERFECT_UNIT if sensor in (None, "perfect") else 1e-3


def _placed(scene: Scene, vessel: VesselFile) -> Scene:
    """The scene in another vessel: the camera is 0.6 radii off the axis and looks at the lowest point."""
    silo = silo_of(vessel)
    pose = looking_at(silo, 0.6 * silo.radius, 0.1 * silo.radius)
    return replace(scene, silo=silo, pose=pose, defects=defects_of(vessel, silo))


def _write(
    scenes: list[Scene], out: Path, unit: float | None, labels: bool, threads: int, vessel: VesselFile | None
) -> dict[str, Any]:
    _check_empty(out)
    frames = []
    with _whole(out) as folder:
        for index, scene in enumerate(track(scenes, "simulating")):
            frame = scene.render(threads)
            with writing(out):
                (folder / "labels" if labels else folder).mkdir(exist_ok=True)
                entry = _write_frame(frame, folder, f"frame_{index:04d}", unit, labels)
            free = {} if vessel is None else {"ullage_m3": ullage(vessel, scene.silo, frame.true_volume)}
            frames.append({**entry, **free})
        document = _document(scenes[0], unit, frames)
        with writing(out):
            camera_files.dump(scenes[0].told or scenes[0].camera, folder / "camera.json", unit)
            (folder / "truth.json").write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", "utf-8")
    return document


@contextmanager
def _whole(out: Path) -> Iterator[Path]:
    """A folder beside `out` whose files go there once all are written; interrupted, none does."""
    place = out.resolve()
    folder = place.with_name(f".{place.name}-{os.getpid()}")
    try:
        with writing(out):
            folder.mkdir(parents=True)
        yield folder
        with writing(out):
            place.mkdir(exist_ok=True)
            for written in sorted(folder.iterdir()):
                written.rename(place / written.name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check_empty(out: Path) -> None:
    with writing(out):
        if out.exists() and any(out.iterdir()):
            raise UsageError(f"{out}: is not empty; name a new folder, so that no old frame is taken for a new one")


def _write_frame(frame: SimulatedFrame, out: Path, name: str, unit: float | None, labels: bool) -> dict[str, Any]:
    """Writes one frame; returns its entry in truth.json."""
    if unit is None:
        file = f"{name}.npy"
        writers.write_npy(out / file, frame.measured)
    else:
        file = f"{name}.png"
        writers.write_png(out / file, writers.to_raw(frame.measured, unit))
    if labels:
        from PIL import Image

        Image.fromarray(frame.measured_labels).save(out / "labels" / f"{name}.png")
    return {"file": file, **frame.truth()}


def _document(scene: Scene, unit: float | None, frames: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "schema": "siloscope.truth/1",
        "siloscope": __version__,
        "depth_unit": unit,
        "scene": scene.to_dict(),
        "frames": frames,
    }

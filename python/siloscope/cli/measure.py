"""``siloscope measure``: one frame in, the content out."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import siloscope
from siloscope.cli import options
from siloscope.cli.inputs import Frames, is_many, opened
from siloscope.cli.outcome import REFUSED, print_json, writing
from siloscope.cli.progress import say
from siloscope.cli.several import Answers, each
from siloscope.cli.summary import headline
from siloscope.content import Content
from siloscope.content.units import SI, Units
from siloscope.content.units import unit as units_of
from siloscope.io import FrameSource
from siloscope.types.frame import Frame
from siloscope.wording import counted, with_std

CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", metavar="FILE", help="What `calibrate` wrote: pose and geometry.")
]
OutletDiameter = Annotated[float, typer.Option(metavar="M", help="Diameter of an outlet pipe below the cone.")]
OutletLength = Annotated[float, typer.Option(metavar="M", help="Its length below the cone's vertex.")]
Strapping = Annotated[
    Path | None, typer.Option("--strapping", metavar="CSV", help="Strapping table: height (m), volume (m³).")
]
DensityNumber = Annotated[float | None, typer.Option("--density", metavar="KG_M3", help="Bulk density, for the mass.")]
DensityStd = Annotated[float | None, typer.Option(metavar="KG_M3", help="Its standard deviation.")]
Product = Annotated[
    str | None, typer.Option("--product", metavar="NAME|TOML", help="Product whose density to take, such as wheat.")
]
TestWeight = Annotated[
    str | None, typer.Option("--test-weight", metavar="WEIGHT", help="Weighed: lb/bu such as 60, or 77.2kg/hl.")
]
Moisture = Annotated[
    float | None,
    typer.Option("--moisture", metavar="PERCENT", min=0.0, max=59.9, help="Adds the dry matter."),
]
Unit = Annotated[
    str | None,
    typer.Option("--unit", metavar="UNITS", help="For text: m3, l, ft3, bu; kg, t, short-ton, long-ton, cwt, lb."),
]


SETTINGS = (
    *("sensor", "vessel", "diameter", "cylinder", "cone", "bottom", "top", "outlet_diameter", "outlet_length"),
    *("strapping", "density", "density_std", "product", "test_weight", "moisture", "trust"),
)
"""Options that the library takes under the same names."""


def chosen(given: dict[str, Any]) -> dict[str, Any]:
    """What a command was given for `siloscope.measure`."""
    settings = {name: given[name] for name in SETTINGS} | {"trust": given["trust"] or ()}
    return settings | {"moisture": None if given["moisture"] is None else given["moisture"] / 100.0}


def measure(
    files: Frames,
    calibration: CalibrationFile = None,
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    cylinder: options.Cylinder = None,
    cone: options.Cone = None,
    bottom: options.Bottom = None,
    top: options.Top = None,
    vessel: options.VesselFile = None,
    outlet_diameter: OutletDiameter = 0.0,
    outlet_length: OutletLength = 0.0,
    strapping: Strapping = None,
    density: DensityNumber = None,
    density_std: DensityStd = None,
    product: Product = None,
    test_weight: TestWeight = None,
    moisture: Moisture = None,
    intrinsics: options.Intrinsics = None,
    unit: Unit = None,
    pose: Annotated[
        str | None, typer.Option(metavar="R_X,R_Y,T_X,T_Y", help="Pose (rad, m) in a bin whose outline --vessel has.")
    ] = None,
    pose_std: Annotated[
        str | None, typer.Option(metavar="RAD,M", help="Standard deviations of the pose's angles and place.")
    ] = None,
    previous: Annotated[
        Path | None, typer.Option(metavar="FRAME", help="The frame before, to see whether the content moves.")
    ] = None,
    mask: Annotated[Path | None, typer.Option(help="Image or .npy, not 0 where the silo is.")] = None,
    number: Annotated[int | None, typer.Option("--frame", min=0, help="Which frame of several, from 0.")] = None,
    every: Annotated[bool, typer.Option("--all", help="Every frame of a recording, not its first.")] = False,
    stream: options.Stream = None,
    trust: options.Trust = None,
    axes: options.Axes = None,
    up: options.Up = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write the JSON, the map and pictures here.")] = None,
    as_json: options.AsJson = False,
) -> int:
    """Measure what is in the silo: level, volume, fill and mass, each with its deviation.

    [bold]Example:[/bold] siloscope measure frame.png --calibration silo7.json --product wheat --out reading

    Without --calibration the frame itself must show enough wall. Several files and folders give a table, or with --json
    a line each; of a recording its first frame counts, or the one of --frame, or --all; `track` tells their story.
    Exit code 4: the frame was read well, but gives no trustworthy answer; the JSON says why. 5: some of several do.
    """
    settings, units = {**chosen(locals()), "intrinsics": intrinsics}, units_of(unit)
    place = {"camera": camera, "depth_unit": depth_unit, "stream": stream, "axes": axes, "up": up}
    silo = None if calibration is None else siloscope.Calibration.load(calibration)
    if pose is not None:
        settings["pose"] = siloscope.SiloPose(*options.numbers(pose, 4, "--pose"))
    if pose_std is not None:
        settings["pose_std"] = tuple(options.numbers(pose_std, 2, "--pose-std"))
    before = None
    if previous is not None:
        with opened([previous], **place) as source:
            before = siloscope.measure(source[0], silo, **settings)

    def one(frame: Frame) -> Content:
        inside = None if mask is None else _mask(mask, frame)
        return siloscope.measure(frame, silo, mask=inside, previous=before, **settings)

    with opened(files, **place) as source:
        if number is None and (every or is_many(files, source)):
            return _each(source, one, out, (as_json, units))
        content = one(options.one_frame(source, number or 0))
    return _answer(content, out, as_json, units)


def _each(source: FrameSource, one: Callable[[Frame], Content], out: Path | None, shown: tuple[bool, Units]) -> int:
    """The answer of every frame, with --out in a folder each."""
    as_json, units = shown
    columns = tuple(f"{name} ({sign})" for name, (_, sign) in zip(("volume", "mass"), units, strict=True))
    answers = Answers((*columns, "level (m)", ""), as_json)
    for number, (frame, content) in enumerate(each(source, one, "measuring")):
        answers.add(frame, content, _short_row(content, units))
        if out is not None:
            _write(out / f"{number:04d}", content)
    return answers.finish(source.problems)


def _short_row(content: Content, units: Units) -> tuple[str, ...]:
    """A content's row in the table for many frames; a refused one has its reason."""
    if not content.ok:
        return "", "", "", f"refused: {content.reason}"
    (m3, _), (kilograms, _) = units
    volume = "" if content.volume is None else with_std(content.volume, content.volume_std, 1.0 / m3, "")
    mass = "" if content.mass is None else with_std(content.mass, content.mass_std, 1.0 / kilograms, "")
    remarks = ", ".join(remark.code for remark in content.quality)
    return volume, mass, with_std(content.level.mean, content.level.std, 1.0, ""), remarks


def _mask(mask: Path, frame: Frame) -> Any:
    from siloscope.estimation import region

    shape = frame.points.shape[:-1] if frame.points is not None else frame.depth.shape  # type: ignore[union-attr]
    return region.read_mask(mask, shape)


def _answer(content: Content, out: Path | None, as_json: bool, units: Units) -> int:
    if out is not None:
        _write(out, content)
    if as_json:
        print_json(content.to_dict())
    else:
        print_content(content, units)
    return 0 if content.ok else REFUSED


def _write(out: Path, content: Content) -> None:
    from siloscope.reporting.content_files import write_content

    with writing(out):
        written = write_content(out, content)
    say(f"wrote {counted(len(written), 'file')} to {out}")


def print_content(content: Content, units: Units = SI) -> None:
    """A short table on stdout, remarks on stderr."""
    console = Console(highlight=False, soft_wrap=True)
    if not content.ok:
        console.print(headline(False, f"{content.source}: {content.reason}"))
        console.print(content.message or "", markup=False)
        return
    console.print(headline(True, content.source))
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_column(style="dim")
    for row in _rows(content, units):
        table.add_row(*map(escape, row))
    console.print(table)
    if content.message:
        say(content.message)
    for line in content.assumed:
        say(f"assumed: {line}")
    for remark in content.quality:
        say(f"{remark.code}: {remark.message} ({remark.seen}); {remark.advice}")


DATUM_WORDS = {
    "cone-vertex": "over the cone's vertex",
    "floor": "over the floor",
    "lowest-seen": "over the lowest point seen",
}
"""What heights are measured from."""


def _edge(content: Content) -> str:
    """Up to where the ullage counts."""
    given = content.lengths is not None and content.lengths.top_from != "camera"
    return "free below the upper edge" if given else "free below the camera's height"


def _rows(content: Content, units: Units) -> list[tuple[str, str, str]]:
    """What a person wants to read, line by line."""
    level = content.level
    datum = DATUM_WORDS.get(content.height_datum or "", "")
    (m3, volume_sign), (kilograms, mass_sign) = units
    rows = [("volume", _volume(content, units), "")]
    if content.ullage is not None:
        rows.append(
            ("ullage", with_std(content.ullage, content.ullage_std, 1.0 / m3, f" {volume_sign}"), _edge(content))
        )
    if content.fill_fraction is not None and content.capacity is not None:
        rows.append(("fill", f"{100 * content.fill_fraction:.1f} %", f"of {content.capacity / m3:.2f} {volume_sign}"))
    if content.mass is not None:
        name = (content.density or {}).get("name", "")
        rows.append(("mass", with_std(content.mass, content.mass_std, 1.0 / kilograms, f" {mass_sign}"), name))
    if content.dry_mass is not None:
        rows.append(("dry matter", f"{content.dry_mass / kilograms:.4g} {mass_sign}", ""))
    spread = "" if level.min is None or level.max is None else f"{level.min:.2f} to {level.max:.2f} m, "
    rows.append(("level", with_std(level.mean, level.std, 1.0, " m"), f"{spread}{datum}"))
    if content.shape is not None:
        steep = math.degrees(abs(content.shape.flank))
        rows.append(("surface", content.shape.form, f"flank {steep:.0f}°"))
    if content.coverage is not None:
        rows.append(("seen", f"{100 * content.coverage:.0f} %", "of the surface"))
    return rows


def _volume(content: Content, units: Units) -> str:
    if content.volume is None:
        return f"unknown; missing: {', '.join(content.missing)}"
    m3, sign = units[0]
    return with_std(content.volume, content.volume_std, 1.0 / m3, f" {sign}")

"""``siloscope measure``: one frame and a calibration in, the content out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import siloscope
from siloscope.cli import options
from siloscope.cli.outcome import REFUSED, print_json
from siloscope.content.result import Content


def measure(
    file: Annotated[Path, typer.Argument(metavar="FRAME", help="Depth image, depth array, point cloud or recording.")],
    calibration: Annotated[
        Path | None, typer.Option("--calibration", "-c", help="What `siloscope calibrate` wrote for this silo.")
    ] = None,
    camera: options.CameraFile = None,
    sensor: options.Sensor = None,
    depth_unit: options.DepthUnit = None,
    diameter: options.Diameter = None,
    cylinder: Annotated[float | None, typer.Option(help="Datasheet: height of the cylinder, m.")] = None,
    cone: Annotated[float | None, typer.Option(help="Datasheet: height of the cone, m.")] = None,
    strapping: Annotated[Path | None, typer.Option(help="Strapping table, CSV of height and volume.")] = None,
    density: Annotated[float | None, typer.Option(help="Bulk density, kg/m³.")] = None,
    product: Annotated[str | None, typer.Option(help="Product of the density table, or a TOML file.")] = None,
    number: Annotated[int, typer.Option("--frame", min=0, help="Which frame of several, from 0.")] = 0,
    stream: options.Stream = None,
    as_json: options.AsJson = False,
) -> int:
    """Measure what is in the silo: level, volume, fill and mass, each with its standard deviation.

    [bold]Example:[/bold] siloscope measure frame.png --calibration silo7.json --density 650 --json

    Without a calibration the frame itself has to show the silo; the answer says what was assumed. Exit code 4: the
    frame does not show enough for an answer, which then says why.
    """
    with siloscope.frames.open(file, camera=camera, depth_unit=depth_unit, stream=stream) as source:
        frame = options.one_frame(source, number)
    content = siloscope.measure(
        frame,
        calibration,
        sensor=sensor,
        diameter=diameter,
        cylinder=cylinder,
        cone=cone,
        strapping=strapping,
        density=density,
        product=product,
    )
    if as_json:
        print_json(content.to_dict())
    else:
        _print(content)
    return 0 if content.ok else REFUSED


def _print(content: Content) -> None:
    """The answer for people: metres, tonnes and per cent."""
    if not content.ok:
        print(f"{content.source}: no answer ({content.reason}). {content.message}")
        return
    rows = [
        ("volume", _with_std(content.volume, content.volume_std, "m³")),
        ("fill", "not known" if content.fill_fraction is None else f"{100 * content.fill_fraction:.1f} %"),
        ("level (mean)", _with_std(content.level.mean, None, "m")),
        ("mass", _with_std(content.mass, content.mass_std, "kg")),
        ("surface seen", "not known" if content.coverage is None else f"{100 * content.coverage:.0f} %"),
    ]
    for name, value in rows:
        print(f"{name:14s} {value}")
    for remark in content.quality:
        print(f"note: {remark.code}")
    for assumed in content.assumed:
        print(f"assumed: {assumed}")


def _with_std(value: float | None, std: float | None, unit: str) -> str:
    if value is None:
        return "not known"
    return f"{value:.2f} {unit}" if std is None else f"{value:.2f} ± {std:.2f} {unit}"

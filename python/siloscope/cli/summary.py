"""An estimate as a person reads it: degrees and millimetres, what was seen, and what it means."""

from __future__ import annotations

import math

from rich.console import Console
from rich.table import Table
from rich.text import Text

from siloscope.reasons import BOTTOM_EVIDENCE
from siloscope.types.calibration import Calibration
from siloscope.types.estimate import Estimate, Ratios
from siloscope.types.floor import Floor
from siloscope.types.vessel import SiloGeometry
from siloscope.wording import with_std

_ROWS = (
    ("r_x", "turn about the camera's x-axis", math.degrees(1.0), "°"),
    ("r_y", "turn about the y-axis after it", math.degrees(1.0), "°"),
    ("t_x", "camera's place beside the axis, x", 1000.0, " mm"),
    ("t_y", "camera's place beside the axis, y", 1000.0, " mm"),
)


def print_estimate(estimate: Estimate, source: str) -> None:
    """A short table on stdout."""
    console = Console(highlight=False, soft_wrap=True)
    if not estimate.ok:
        console.print(headline(False, f"{source}: {estimate.reason}"))
        console.print(estimate.message or "", markup=False)
        _print_quality(console, estimate)
        return
    console.print(headline(True, f"{source}: method {estimate.method}"))
    console.print(pose_table(estimate))
    for line in (tilt_line(estimate), silo_line(estimate.silo, estimate.silo_std), ratios_line(estimate.pixel_ratios)):
        if line:
            console.print(line, markup=False)
    _print_quality(console, estimate)


def _print_quality(console: Console, estimate: Estimate) -> None:
    """The remarks, but for the one that the refusal's message has."""
    for remark in estimate.quality:
        if remark.code != estimate.reason:
            console.print(f"{remark.severity}: {remark.text}; {remark.advice}", markup=False)


def headline(ok: bool, rest: str) -> Text:
    """The first line of an answer; brackets in a file's name are no markup."""
    return Text.assemble(("ok     ", "bold green") if ok else ("refused", "bold yellow"), f" {rest}")


def pose_table(estimate: Estimate | Calibration) -> Table:
    """The four numbers of the pose with their standard deviations."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_column(style="dim")
    stds = estimate.to_dict()["std"]
    for name, meaning, factor, unit in _ROWS:
        table.add_row(name, with_std(getattr(estimate, name), stds[name], factor, unit), meaning)
    return table


def tilt_line(estimate: Estimate | Calibration) -> str:
    """The pose in words."""
    pose = estimate.pose
    if pose is None:
        return ""
    tilt = math.degrees(math.acos(max(-1.0, min(1.0, float(pose.axis_direction[2])))))
    return (
        f"The camera looks {tilt:.2f}° off the axis and hangs {math.hypot(pose.t_x, pose.t_y) * 1000:.1f} mm beside it."
    )


def silo_line(silo: SiloGeometry, std: SiloGeometry) -> str:
    """The geometry with its standard deviations."""
    parts = [
        f"{name} {with_std(getattr(silo, key), getattr(std, key), 1000.0, ' mm')}"
        for key, name in (
            ("radius", "radius"),
            ("cylinder_bottom", "cylinder's bottom below the camera"),
            ("apex", "cone's vertex below the camera"),
        )
    ]
    return "Silo: " + ", ".join(parts) + "."


def ratios_line(ratios: Ratios | None) -> str:
    """What the pixels show."""
    if ratios is None:
        return ""
    parts = [f"{name} {100 * share:.0f} %" for name, share in ratios.to_dict().items()]
    return "Pixels: " + ", ".join(parts) + "."


def floor_line(floor: Floor) -> str:
    """What is known of the bottom, and how."""
    if floor.evidence is not None:
        return f"bottom: {floor.kind} ({BOTTOM_EVIDENCE[floor.evidence]})"
    seen = "none was seen" if floor.seen is None else f"the conical surface seen ({floor.seen}) may be feed"
    return f"bottom: unknown, {seen}; --bottom or --empty tells"

"""The page of a comparison: what changed in all, by silo, of the poses, and the frames that changed most."""

from __future__ import annotations

from typing import Any

from siloscope.reporting.report import Report, table, text
from siloscope.types.track import utc
from siloscope.wording import counted, with_std

MOST_ROWS = 500
"""Silos and cameras that are listed, those that changed most first."""


def page(found: dict[str, Any]) -> Report:
    """The page of a document of `siloscope.fleet.diff.diff`."""
    whole, before, after = found["all"], found["before"], found["after"]
    lead = f"{_run(before)} against {_run(after)}: {counted(whole['frames'], 'frame')} in both."
    report = Report("What changed between two runs", lead).cards(_cards(whole))
    silos = sorted(found["silos"].items(), key=lambda item: -(item[1]["volume_m3"]["largest"] or 0.0))
    report.section("By silo", table(_SILO_HEAD, [_silo(*item) for item in silos[:MOST_ROWS]]))
    poses = sorted(found["poses"].items(), key=lambda item: -(item[1]["largest_in_deviations"] or 0.0))
    report.section("Poses", table(_POSE_HEAD, [_pose(*item) for item in poses[:MOST_ROWS]]))
    if whole["quality"]:
        rows = [(_sign(code), code[1:], str(count)) for code, count in whole["quality"].items()]
        report.section("Remarks", table(("", "Remark", "Frames"), rows))
    worst = [_frame(row) for row in found["worst"]]
    shown = table(_FRAME_HEAD, worst) if worst else text("None: no frame changed.")
    return report.section("The frames that changed most", shown)


_SILO_HEAD = (
    *("Silo", "Frames", "Same to the last bit", "Answer gained", "lost", "Only before", "Only after"),
    *("Mean change", "RMS", "Largest", "Deviation after / before"),
)
_POSE_HEAD = ("Silo and camera", "Turn", "Shift", "In deviations")
_FRAME_HEAD = (
    "Silo",
    "Camera",
    "Time",
    "Before",
    "After",
    "Change",
    "In deviations",
    "Remarks before",
    "after",
    "Frame",
)


def _run(told: dict[str, Any]) -> str:
    return f"Run {told['run']} of siloscope {told['version']}"


def _cards(whole: dict[str, Any]) -> list[tuple[str, str]]:
    volume = whole["volume_m3"]
    return [
        (str(whole["same"]), "frames the same to the last bit"),
        (str(whole["gained"]), "frames that gained an answer"),
        (str(whole["lost"]), "frames that lost theirs"),
        (_litres(volume["rms"]), "RMS change of the volume"),
        (_litres(volume["largest"]), "largest change"),
    ]


def _litres(value: float | None) -> str:
    return "none" if value is None else f"{1e3 * value:.3g} l"


def _silo(silo: str, change: dict[str, Any]) -> tuple[str, ...]:
    names = ("frames", "same", "gained", "lost", "only_before", "only_after")
    volume, ratio = change["volume_m3"], change["std_ratio"]
    sizes = (_litres(volume[name]) for name in ("mean", "rms", "largest"))
    return (silo, *(str(change[name]) for name in names), *sizes, "" if ratio is None else f"{ratio:.3f}")


def _pose(name: str, change: dict[str, Any]) -> tuple[str, ...]:
    size = change["largest_in_deviations"]
    turn, shift = f"{1e3 * change['turn']:.3f} mrad", f"{1e3 * change['shift']:.2f} mm"
    return name, turn, shift, "" if size is None else f"{size:.2f}"


def _sign(code: str) -> str:
    return "new" if code.startswith("+") else "gone"


def _frame(row: dict[str, Any]) -> tuple[str, ...]:
    before, after, size = row["before"], row["after"], row["deviations"]
    time = utc(row["seconds"]) or ("" if row["seconds"] is None else f"{row['seconds']:.3f} s")
    return (
        row["silo"],
        row["camera"],
        time,
        _value(before),
        _value(after),
        _litres(row["gap_m3"]),
        f"{size:.2f}" if size < float("inf") else "answer changed",
        before["quality"],
        after["quality"],
        row["sha256"][:12],
    )


def _value(side: dict[str, Any]) -> str:
    if side["status"] != "ok":
        return f"{side['status']}: {side['reason']}"
    if side["volume_m3"] is None:
        return f"free {with_std(side['ullage_m3'], None, 1.0, ' m³')}"
    return with_std(side["volume_m3"], side["volume_std_m3"], 1.0, " m³")

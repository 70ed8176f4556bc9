"""A validation as a page and a document."""

from __future__ import annotations

from pathlib import Path

from siloscope.reporting.renewal import without_older
from siloscope.reporting.report import Report, picture, table, text
from siloscope.schema import documents
from siloscope.validation.findings import CONVICTS, NAMES
from siloscope.validation.validate import Validation
from siloscope.wording import counted


def write_validation(directory: Path, found: Validation) -> list[Path]:
    """Writes ``validation.json`` and ``report.html``; returns their paths.

    Raises `OSError` where the directory can't be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    document = documents.write(directory / "validation.json", found.to_dict())
    page = report(found).write(directory / "report.html")
    return without_older(directory, [document, page], ())


def report(found: Validation) -> Report:
    """The page: verdict, findings, what is left on the wall, held-out frames, halves, other noise."""
    page = Report("Does it agree with your own frames?", found.summary or found.message or "")
    page.cards(_cards(found))
    if found.findings:
        page.section("What does not agree", *(text(f"{one.message} {one.remedy}") for one in found.findings))
    if not found.ok or found.ideal is None:
        return page
    from siloscope.reporting.plots import png
    from siloscope.reporting.plots.validation import halves_apart, held_out_frames, left_on_the_wall

    left = png(left_on_the_wall(found.ideal.tiles))
    page.section(
        "What is left on the wall",
        text(
            "The camera and the silo stand still, so noise averages out here and what lasts stays: a pattern is the "
            "sensor's, the camera's or the wall's. The test of each cause counts how rare its pattern is by chance: "
            f"beyond {CONVICTS:g} deviations it is none."
        ),
        picture(left, "Residuals against an ideal vessel, averaged over the frames."),
        _tests(found),
    )
    if found.held_out:
        shown = picture(png(held_out_frames(found.held_out)), "Residuals of held-out frames; deviations in the titles.")
        page.section("Levels that were left out", shown, _held(found))
    for split in found.splits:
        shown = picture(png(halves_apart(split)), f"The two walls of the {split.name}, apart.")
        page.section(f"Calibrated twice: {split.name}", _halves(split.differences), shown)
    if found.resampled is not None:
        page.section("Solved again with other noise", _resampled(found))
    if found.without:
        page.section("Frames without an answer", table(("Frame", "Why"), [list(one) for one in found.without[:100]]))
    return page


def _cards(found: Validation) -> list[tuple[str, str]]:
    if not found.ok:
        return [("no verdict", found.reason or "")]
    worst = max((one.deviation for one in found.tests.values()), default=0.0)
    return [
        ("agrees" if not found.findings else "departs", "verdict"),
        (counted(found.used, "frame"), f"used, {len(found.without)} without an answer"),
        (f"{worst:.1f}", f"deviations of the rarest pattern; chance ends at {CONVICTS:g}"),
    ]


def _tests(found: Validation) -> str:
    rows = [
        (NAMES[name], f"{one.deviation:.1f}", f"{one.unsteady:.1f}", str(one.dof)) for name, one in found.tests.items()
    ]
    return table(("Cause", "Lasting pattern, deviations", "From frame to frame, deviations", "Patterns"), rows)


def _held(found: Validation) -> str:
    rows = [
        (
            one.name,
            str(one.level + 1),
            f"{1e3 * one.rms:.2f} mm",
            f"{1e3 * one.expected:.2f} mm",
            f"{one.deviation:.1f}",
        )
        for one in found.held_out
    ]
    return table(("Frame", "Level", "Residuals", "Expected", "Pattern, deviations"), rows)


def _halves(differences: dict[str, tuple[float, float]]) -> str:
    rows = []
    for name, (off, std) in differences.items():
        factor, unit = (1e3, "mrad") if name.startswith("r_") else (1.0, "") if "slope" in name else (1e3, "mm")
        rows.append((name, f"{factor * off:+.3g} {unit}", f"{factor * std:.3g} {unit}", f"{abs(off) / std:.1f}"))
    return table(("Parameter", "Difference", "Deviation of both", "Ratio"), rows)


def _resampled(found: Validation) -> str:
    again = found.resampled
    if again is None:
        return ""
    rows = [
        (name, f"{1e3 * again.scatter[name]:.3f}", f"{1e3 * std:.3f}", f"{again.scatter[name] / std:.2f}")
        for name, std in again.stated.items()
    ]
    said = text(
        f"{again.answers} answers to the same frames, made exact and disturbed anew by the sensor's noise. Noise is "
        "only a part of what is stated, so a ratio below 1 is as it should be."
    )
    return said + table(("Parameter (mm, mrad)", "Scatter", "Stated", "Ratio"), rows)

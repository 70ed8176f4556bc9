"""The demo's report: what was done, what came out, what it means."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import siloscope
from siloscope.reporting import plots
from siloscope.reporting.demo import METHODS, SCENE, SENSOR, Step, content
from siloscope.reporting.report import Report, command, picture, table, text
from siloscope.reporting.results import pictures
from siloscope.simulation.metrics import transform_error
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content

_NAMES = {"surface": "surface fit", "shape-tensor": "the paper's six steps"}
_DPI = 100


def page(steps: Sequence[Step], calibration: Calibration, contents: Sequence[Content]) -> Report:
    """The report of a discharge, what all its frames say together, and what each holds."""
    last = steps[-1]
    report = Report(
        "A silo, emptied in front of a depth camera",
        f"Simulated: {len(steps)} frames of a {2 * SCENE.silo.radius:.1f} m wide silo, from nearly full to empty, seen "
        "by a low-cost depth camera that hangs beside the axis and looks askew. From each frame alone, siloscope says "
        "where the silo's axis is, and how sure it is.",
        footer=f"siloscope {siloscope.__version__}, numpy {np.__version__}. This page holds everything it shows.",
    )
    report.cards(_cards(steps))
    shown = pictures(last.seen.frame(), last.estimates["surface"])
    clouds = [_png(shown["clouds"], _CLOUDS)] if "clouds" in shown else []
    report.section("What was found in the last frame", *_found(last), *clouds)
    report.section("Over the discharge", *_discharge(steps))
    report.section("All frames together", *_calibration(steps, calibration))
    report.section("What is in it", *content.section(steps, contents))
    report.section("How it is found", *_how(shown))
    report.section("What this means, and what it does not", *_meaning(steps))
    return report.section("Your own frame", *_yours())


def _cards(steps: Sequence[Step]) -> list[tuple[str, str]]:
    found = [step for step in steps if step.estimates["surface"].ok]
    off = [1e3 * step.distances["surface"] for step in found]
    return [
        (
            f"{_mm(np.median(off))}" if off else "none",
            "typical distance between the cloud as found and as it truly lies",
        ),
        (f"{len(found)} of {len(steps)}", "frames answered; the others show too little wall and were refused"),
        (_within(steps), "of the errors are within two stated standard deviations"),
        (f"{np.median([step.milliseconds['surface'] for step in steps]):.0f} ms", "for one frame of 640 × 480 pixels"),
    ]


def _found(step: Step) -> list[str]:
    estimate, truth = step.estimates["surface"], step.seen.pose
    if estimate.pose is None:
        return [text(f"The last frame was refused: {estimate.message}")]
    names = (("r_x", "°"), ("r_y", "°"), ("t_x", "mm"), ("t_y", "mm"))
    std = step.std("surface")
    rows = []
    for i, (name, unit) in enumerate(names):
        factor = math.degrees(1.0) if unit == "°" else 1e3
        value, true = factor * getattr(estimate.pose, name), factor * getattr(truth, name)
        rows.append(
            [name, f"{value:.3f} {unit}", f"± {factor * std[i]:.3f}", f"{true:.3f} {unit}", f"{value - true:+.3f}"]
        )
    matrix = [[f"{number:+.6f}" for number in row] for row in estimate.pose.T_silo_camera]
    return [
        text(
            "Two angles say how the camera is turned in the silo, two lengths where it hangs beside the axis. The "
            "truth is known here because the silo is simulated."
        ),
        table(["", "found", "one std", "truth", "error"], rows),
        text("Together they are one matrix that takes points from camera to silo, p_silo = T_silo_camera · p_camera:"),
        table(["T_silo_camera", "", "", ""], matrix),
        _silo(estimate.silo),
    ]


def _silo(silo: siloscope.SiloGeometry) -> str:
    true = SCENE.silo.geometry
    rows = [
        [name, f"{found:.4f} m" if found is not None else "not seen", f"{real:.4f} m"]
        for name, found, real in (
            ("radius", silo.radius, true.radius or 0.0),
            ("cylinder's bottom, below the camera", silo.cylinder_bottom, true.cylinder_bottom or 0.0),
            ("cone's vertex, below the camera", silo.apex, true.apex or 0.0),
        )
    ]
    return text("The silo itself comes out of the same frame:") + table(["", "found", "truth"], rows)


def _discharge(steps: Sequence[Step]) -> list[str]:
    level = np.array([step.level for step in steps])
    error, std = (np.array([getattr(step, what)("surface") for step in steps]) for what in ("error", "std"))
    share = np.array([list(step.seen.pixel_ratios.to_dict().values()) for step in steps])
    distance = {_NAMES[method]: np.array([step.distances[method] for step in steps]) for method in METHODS}
    return [
        text(
            "The fuller the silo, the less wall is seen. Each point below is one frame on its own; nothing is carried "
            "over from the frame before."
        ),
        _png(plots.errors(level, error, std, "Errors of the surface fit, frame by frame"), _ERRORS),
        _png(plots.ratios(level, share, distance, "What the camera sees, and how far off the cloud is"), _RATIOS),
        table(
            ["", "frames answered", "median", "worst"],
            [[name, *_spread(values)] for name, values in distance.items()],
        ),
        text("PC average distance (Eq. 11): the mean distance of the cloud as found from the cloud as it truly lies."),
        *_refusals(steps),
    ]


def _refusals(steps: Sequence[Step]) -> list[str]:
    """Why the surface fit gave no answer, and at which feed levels."""
    levels: dict[str, list[float]] = {}
    for step in steps:
        estimate = step.estimates["surface"]
        if not estimate.ok:
            levels.setdefault(estimate.message or "", []).append(step.level)
    rows = [[message, str(len(at)), f"{max(at):.0%} to {min(at):.0%}"] for message, at in levels.items()]
    return [text("Where it refused, and what it said:"), table(["", "frames", "feed level"], rows)] if rows else []


def _spread(distance: NDArray[np.float64]) -> list[str]:
    found = 1e3 * distance[np.isfinite(distance)]
    if not len(found):
        return [f"0 of {len(distance)}", "–", "–"]
    return [f"{len(found)} of {len(distance)}", _mm(np.median(found)), _mm(found.max())]


def _calibration(steps: Sequence[Step], found: Calibration) -> list[str]:
    """What fusing the discharge gains over its best frame."""
    if found.pose is None:
        return [text(f"No calibration: {found.message}")]
    truth = SCENE.pose
    error = np.array(list(transform_error(found.pose, truth).to_dict().values()))
    std = np.sqrt(np.diag(found.covariance)) if found.covariance is not None else np.full(4, np.nan)
    last = steps[-1]
    rows = [
        [name, *_error_cells(i, last.error("surface")[i], last.std("surface")[i]), *_error_cells(i, error[i], std[i])]
        for i, name in enumerate(("r_x", "r_y", "t_x", "t_y"))
    ]
    return [
        text(
            "A silo is emptied and filled for years, and its camera stays where it is. So the frames are fused: each "
            "counts by what it shows, and those that disagree don't count. This is what is kept for a silo, in "
            "calibration.json."
        ),
        table(["", "last frame: error", "one std", f"{found.counts['used']} frames fused: error", "one std"], rows),
    ]


def _error_cells(parameter: int, error: float, std: float) -> list[str]:
    unit = "mrad" if parameter < 2 else "mm"
    return [f"{1e3 * error:+.4f} {unit}", f"± {1e3 * std:.4f}"]


def _how(shown: dict[str, Any]) -> list[str]:
    texts = {"depth": _DEPTH, "candidates": _CANDIDATES, "directions": _DIRECTIONS, "profile": _PROFILE}
    return [_png(shown[name], caption, name == "depth") for name, caption in texts.items() if name in shown]


def _meaning(steps: Sequence[Step]) -> list[str]:
    refused = [step for step in steps if not step.estimates["surface"].ok]
    first = next((step for step in steps if step.estimates["surface"].ok), None)
    answered = (
        "No frame was answered." if first is None else f"The first answer comes at a feed level of {first.level:.0%}."
    )
    return [
        text(
            f"{answered} {len(refused)} frames were refused: an axis from too little wall would look as exact as any "
            "other and be wrong, so there is none.",
            "With the axis known, every point of the cloud has a height and a distance from the wall; level, volume "
            "and mass follow from there, without anybody having measured where the camera hangs.",
            f"The sensor is simulated with the bias and noise published for the Orbbec Astra S ({SENSOR}), whole "
            "millimetres, holes and flying pixels. The surface fit is told that profile; the six steps of the paper "
            f"take the cloud as it is, and the sensor's bias, {_bias_at_the_vertex()} at the cone's vertex, is in "
            "their answer.",
            "The camera's focal lengths and principal point are exact here, and are taken as a calibrated camera's: "
            "what such a camera leaves open is most of every deviation stated above; the errors are smaller.",
            "A simulated silo is rounder and cleaner than a real one. Dents, ladders and dust make a real answer less "
            "exact than this page.",
        )
    ]


def _bias_at_the_vertex() -> str:
    return _mm(1e3 * float(SCENE.sensor.bias_at(SCENE.silo.geometry.apex or 0.0)))


def _yours() -> list[str]:
    return [
        text("The last frame lies beside this page as a user would have it. This finds its axis again:"),
        command("siloscope locate frame.png --camera camera.json --sensor orbbec-astra-s --out result"),
        text("For a sensor whose profile you don't have, give a diameter of the silo instead:"),
        command("siloscope locate yours.png --camera yours.json --depth-unit 0.001 --diameter 2.80"),
    ]


def _within(steps: Sequence[Step]) -> str:
    errors, stds = (np.array([getattr(step, what)("surface") for step in steps]) for what in ("error", "std"))
    known = np.isfinite(errors) & np.isfinite(stds)
    return f"{np.mean(np.abs(errors[known]) <= 2 * stds[known]):.0%}" if known.any() else "–"


def _mm(value: float) -> str:
    return f"{value:.2g} mm" if value < 10 else f"{value:.0f} mm"


def _png(figure: Any, caption: str, narrow: bool = False) -> str:
    return picture(plots.png(figure, dpi=_DPI), caption, narrow)


_CLOUDS = (
    "The cloud as the camera gives it (red), and moved into the silo frame with the sensor's bias taken out (blue): "
    "the axis is upright and the wall stands where a wall stands."
)
_ERRORS = "Error of each parameter against the feed level; the bands are two stated standard deviations. Grey: refused."
_RATIOS = (
    "Left: what the pixels show. Right: how far the cloud as found lies from the truth, on a logarithmic scale, for "
    "both methods."
)
_DEPTH = "The frame: depth from blue (near) to yellow (far); grey pixels have no measurement."
_CANDIDATES = (
    "The paper's third step: points where one curvature is near zero and the other is not are likely wall, and only "
    "they vote for the axis."
)
_DIRECTIONS = (
    "Its fourth step: each pair of candidates gives one estimate of the axis direction. One alone is poor; all "
    "together are better."
)
_PROFILE = (
    "The check: the frame folded about the axis found. The wall becomes one line, and its residuals show what the "
    "sensor's noise leaves; feed and stray points lie off it and were not used."
)

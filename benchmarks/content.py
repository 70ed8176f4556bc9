"""How far the measured volume is off, on silos that nobody has seen: perturbed frames, calibrated from five others.

    python benchmarks/content.py [--silos N] [--first SEED] [--unknown] [--true-pose] [--json]

Every silo is `siloscope.paper.scenarios.random_scene`; it is calibrated from five frames of an earlier discharge, then
Gaussian, funnel, mound and tilted feed is measured at 75, 45 and 20 % level. Errors are in % of the silo's capacity.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import siloscope
from siloscope.errors import UsageError
from siloscope.paper.scenarios import random_scene
from siloscope.scene import ASTRA_S, Feed, Scene
from siloscope.surface import PARAMETERS

SHAPES = ("gaussian", "funnel", "mound", "tilted")
LEVELS = (0.75, 0.45, 0.20)
EARLIER = (0.7, 0.5, 0.35, 0.2, 0.05)
"""Levels of the discharge that the silo is calibrated from."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--silos", type=int, default=12)
    options.add_argument("--first", type=int, default=5000, help="seed of the first silo")
    options.add_argument("--unknown", action="store_true", help="no sensor profile, but the diameter")
    options.add_argument("--true-pose", action="store_true", help="the true pose and geometry instead of a calibration")
    options.add_argument("--json", action="store_true")
    chosen = options.parse_args()
    rows = [row for seed in range(chosen.first, chosen.first + chosen.silos) for row in silo(seed, chosen)]
    summary = summarise(rows)
    if chosen.json:
        print(json.dumps({"rows": rows, "summary": summary}, indent=1))
        return
    for row in rows:
        print(line(row))
    print(json.dumps(summary))


def silo(seed: int, chosen: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """All readings of one silo."""
    scene = random_scene(seed, sensor=ASTRA_S)
    settings: dict[str, Any] = {"sensor": "orbbec-astra-s"}
    if chosen.unknown:
        settings = {"diameter": 2.0 * scene.silo.radius}
    calibration = truth(scene) if chosen.true_pose else calibrated(scene, settings)
    draw = np.random.default_rng(seed)
    for shape in SHAPES:
        for level in LEVELS:
            yield reading(seed, scene, shape, level, calibration, settings, draw)


def calibrated(scene: Scene, settings: dict[str, Any]) -> siloscope.Calibration:
    earlier = [
        replace(scene, feed=Feed("gaussian", level), seed=scene.seed + 100 + i) for i, level in enumerate(EARLIER)
    ]
    return siloscope.calibrate([s.render().frame() for s in earlier], **settings)


def truth(scene: Scene) -> siloscope.Calibration:
    """A calibration without error."""
    g, pose = scene.silo.geometry, scene.pose
    slope = g.radius / (g.apex - g.cylinder_bottom)
    values = [pose.r_x, pose.r_y, pose.t_x, pose.t_y, g.radius, slope, g.apex, *scene.sensor.bias, 0.0, 0.0]
    profile = siloscope.sensors.load("orbbec-astra-s").to_dict()
    return siloscope.Calibration(
        "ok",
        pose=pose,
        covariance=np.zeros((4, 4)),
        silo=g,
        parameters=np.array(values),
        parameter_covariance=np.zeros((len(PARAMETERS),) * 2),
        config={"sensor": profile},
    )


def reading(
    seed: int,
    scene: Scene,
    shape: str,
    level: float,
    calibration: siloscope.Calibration,
    settings: dict[str, Any],
    draw: np.random.Generator,
) -> dict[str, Any]:
    """One reading beside its truth, in % of the capacity."""
    feed = Feed(
        shape,
        level,
        angle=float(draw.uniform(0.35, 0.6)),
        tilt=float(draw.uniform(0.05, 0.4)) if shape == "tilted" else None,
        tilt_azimuth=float(draw.uniform(0.0, 6.28)),
    )
    row: dict[str, Any] = {"seed": seed, "shape": shape, "level": level}
    try:
        frame = replace(scene, feed=feed, seed=scene.seed + 1000 * int(100 * level)).render()
    except UsageError as error:
        return {**row, "status": "not rendered", "reason": str(error)}
    if not calibration.ok:
        return {**row, "status": "no calibration", "reason": calibration.reason or ",".join(calibration.quality)}
    sensor = {k: v for k, v in settings.items() if k == "sensor"}
    start = time.process_time()
    found = siloscope.measure(frame.frame(), calibration, **sensor)
    row |= {
        "ms": 1e3 * (time.process_time() - start),
        "status": found.status,
        "reason": found.reason,
        "coverage": found.coverage,
        "quality": [r.code for r in found.quality],
    }
    if found.volume is None:
        return row
    percent = 100.0 / scene.silo.capacity
    return {
        **row,
        "error": percent * (found.volume - frame.true_volume),
        "std": percent * found.volume_std,
        **{f"std_{k}": percent * v for k, v in found.parts.to_dict().items()},
    }


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    told = [row for row in rows if "error" in row]
    error = np.array([row["error"] for row in told])
    std = np.array([row["std"] for row in told])
    return {
        "readings": len(rows),
        "answered": len(told),
        "not_rendered": sum(row["status"] == "not rendered" for row in rows),
        "median_percent": float(np.median(np.abs(error))),
        "worst_percent": float(np.abs(error).max()),
        "within_1_std": float((np.abs(error) <= std).mean()),
        "within_2_std": float((np.abs(error) <= 2.0 * std).mean()),
        "rms_of_error_over_std": float(np.sqrt(np.mean((error / std) ** 2))),
        "median_ms": float(np.median([row["ms"] for row in told])),
    }


def line(row: dict[str, Any]) -> str:
    head = f"{row['seed']} {row['shape']:9s} {row['level']:.2f}"
    if "error" not in row:
        return f"{head} {row['status']}: {row['reason']}"
    parts = " ".join(f"{k[4:]} {v:.4f}" for k, v in row.items() if k.startswith("std_"))
    found = f"seen {row['coverage']:.2f} error {row['error']:+.4f} std {row['std']:.4f} ({parts})"
    return f"{head} {found} {row['ms']:.1f} ms {','.join(row['quality'])}"


if __name__ == "__main__":
    main()

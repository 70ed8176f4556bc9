"""Draws the pictures that the README and the documentation show: the demo's last frame, a content, and a story.

python docs/make_images.py
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import siloscope
from siloscope.reporting import plots
from siloscope.reporting.demo import SENSOR, scenes
from siloscope.reporting.plots.content import pictures as content_pictures
from siloscope.reporting.results import pictures
from siloscope.reporting.track_page import trend
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import scenario

IMAGES = Path(__file__).parent / "images"
SHOWN = ("overview", "profile")
COLOURS = 256
"""A palette makes the files small enough to keep in the repository."""


STORY = 48
"""Readings of the story, six hours apart."""


def main() -> None:
    """Writes `docs/images/*.png`."""
    seen = scenes(24)[-2].render(threads=2)
    estimate = siloscope.locate(seen.frame(), sensor=SENSOR)
    drawn = pictures(seen.frame(), estimate)
    IMAGES.mkdir(exist_ok=True)
    for name in SHOWN:
        save(name, drawn[name])
    calibration = siloscope.calibrate(
        [frame("gaussian", at, i) for i, at in enumerate((0.5, 0.3, 0.1))], sensor=SENSOR, bottom="cone"
    )
    measured = siloscope.measure(frame("mound+tilted+lumpy", 0.62, 7), calibration)
    for name in ("height-map", "surface"):
        save(name, content_pictures(measured)[name])
    told = siloscope.track(story(), calibration, interval=21_600.0, start=1_772_344_800.0)
    save("trend", trend(told))


def save(name: str, drawn: Figure) -> None:
    """One picture with few colours."""
    with Image.open(io.BytesIO(plots.png(drawn, dpi=120))) as image:
        image.convert("RGB").quantize(COLOURS).save(IMAGES / f"{name}.png", optimize=True)


def frame(shape: str, level: float, seed: int) -> siloscope.Frame:
    """What the low-cost camera sees of the third silo."""
    feed = Feed(shape, level, lump_height=0.04 if "lumpy" in shape else None)
    return replace(scenario("silo3"), sensor=ASTRA_S, feed=feed, seed=seed).render(threads=2).frame()


def story() -> Iterator[siloscope.Frame]:
    """Feed is drawn by day, and the silo is filled when it is nearly empty."""
    draw, level = np.random.default_rng(4), 0.6
    for i in range(STORY):
        level = 0.65 if level < 0.25 else level - (0.002 if i % 4 == 0 else draw.uniform(0.01, 0.05))
        yield frame("mound" if level > 0.5 else "funnel", level, i)


if __name__ == "__main__":
    main()

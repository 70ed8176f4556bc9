"""Draws the pictures that the README and the documentation show, from the demo's last frame.

python docs/make_images.py
"""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image

import siloscope
from siloscope import plots
from siloscope.demo import SENSOR, scenes
from siloscope.results import pictures

IMAGES = Path(__file__).parent / "images"
SHOWN = ("overview", "profile")
COLOURS = 256
"""A palette makes the files small enough to keep in the repository."""


def main() -> None:
    """Writes `docs/images/*.png`."""
    seen = scenes(24)[-2].render(threads=2)
    estimate = siloscope.locate(seen.frame(), sensor=SENSOR)
    drawn = pictures(seen.frame(), estimate)
    IMAGES.mkdir(exist_ok=True)
    for name in SHOWN:
        with Image.open(io.BytesIO(plots.png(drawn[name], dpi=120))) as image:
            image.convert("RGB").quantize(COLOURS).save(IMAGES / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()

"""Draws the pictures of the page of `siloscope serve --demo` that README and documentation show.

python docs/make_page_images.py
"""

from __future__ import annotations

import io
import json
import math
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from siloscope.client import Client
from siloscope.io import writers
from siloscope.monitor.demo.silos import SILOS, UNIT

IMAGES = Path(__file__).parent / "images"

COLOURS = 256
"""A palette makes the files small enough to keep in the repository."""

DESK, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}

CAMERA = "cam-south-1"
"""The farm's silent camera: its only frame is the one that is sent here."""

SHOTS = (
    ("page-overview", "", ".card >> nth=5", DESK, "light"),
    ("page-silo", "#/silos/north-1", "canvas.solid[data-drawn]", DESK, "light"),
    ("page-phone", "", ".card >> nth=5", PHONE, "light"),
    ("page-phone-silo", "#/silos/north-1", "canvas.solid[data-drawn]", PHONE, "dark"),
    ("page-install", f"#/install/{CAMERA}", ".install .big", PHONE, "light"),
)
"""Name, address, what must be there, size, theme."""


def main() -> None:
    """Writes `docs/images/page-*.png`."""
    with TemporaryDirectory() as folder, farm(Path(folder)) as root, sync_playwright() as driver:
        send_turned(root, Path(folder))
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--enable-unsafe-swiftshader"])
        for name, where, selector, size, theme in SHOTS:
            save(name, shot(browser, f"{root}/{where}", selector, size, theme))
        browser.close()


@contextmanager
def farm(data: Path) -> Iterator[str]:
    """A running simulated farm; its address."""
    command = [sys.executable, "-m", "siloscope", "serve", "--demo", "--data", str(data), "--bind", "127.0.0.1:0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        root = process.stdout.readline().strip()
        wait_for(lambda: get(root, "silos")["items"][0]["now"]["frame"])
        yield root
    finally:
        process.terminate()
        process.wait(30)


def get(root: str, path: str) -> Any:
    """An answer of the service; an empty page of silos while it does not answer."""
    try:
        with urllib.request.urlopen(f"{root}/api/v1/{path}", timeout=10) as answer:
            return json.load(answer)
    except OSError:
        return {"items": [{"now": {"frame": None}}], "frame": None}


def wait_for(true: Any) -> None:
    """Waits until something holds."""
    while not true():
        time.sleep(0.5)


def send_turned(root: str, data: Path) -> None:
    """A frame of a nearly empty silo, by a camera that is turned off the axis."""
    silo = next(one for one in SILOS if one.camera == CAMERA)
    scene = silo.scene(0.06 * silo.full, 1)
    pose = replace(scene.pose, r_x=math.radians(7.0), r_y=math.radians(-9.0))
    path = data / "turned.png"
    writers.write_png(path, replace(scene, pose=pose).render().raw(UNIT))
    command = [sys.executable, "-m", "siloscope", "monitor", "token", "--data", str(data)]
    made = subprocess.run(
        [*command, "--role", "camera", "--camera", CAMERA], capture_output=True, text=True, check=True
    )
    Client(root, made.stdout.split()[0]).send(CAMERA, path, captured=time.time() - 25.5 * 3600.0)
    wait_for(lambda: get(root, f"cameras/{CAMERA}/pose")["frame"])


def shot(browser: Browser, address: str, selector: str, size: Any, theme: Any) -> bytes:
    """A picture of a view."""
    context = browser.new_context(viewport=size, color_scheme=theme, locale="en-GB", reduced_motion="reduce")
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector(selector, timeout=90_000)
    if "canvas" in selector and size is PHONE:
        page.locator(selector).evaluate("canvas => canvas.scrollIntoView({ block: 'center' })")
    page.wait_for_timeout(2500)
    taken = page.screenshot()
    context.close()
    return taken


def save(name: str, taken: bytes) -> None:
    """One picture with few colours."""
    with Image.open(io.BytesIO(taken)) as image:
        image.convert("RGB").quantize(COLOURS).save(IMAGES / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()

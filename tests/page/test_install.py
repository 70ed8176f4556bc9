"""The installer's view: legible on a phone, the turn is right, a new frame changes it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from page import pixels
from page.conftest import Running, Visit, token, until, wait_for
from siloscope.client import Client
from siloscope.io import writers
from siloscope.monitor.demo.silos import SILOS, UNIT

CAMERA = "cam-south-1"
"""The farm's silent camera: nothing comes from it but what a test sends."""

BACK_S = 25.5 * 3600.0
"""The frames are from before it fell silent for a day, so that it stays late."""

Send = Callable[[float, float], None]


@pytest.fixture
def send(farm: Running, tmp_path: Path) -> Send:
    """Sends a frame of the nearly empty silo by a camera that is turned off the axis (r_x, r_y), degrees."""
    silo = next(one for one in SILOS if one.camera == CAMERA)
    client = Client(farm.root, token(farm, "camera", CAMERA))

    def sent(r_x: float, r_y: float) -> None:
        scene = silo.scene(0.06 * silo.full, int(time.time()))
        pose = replace(scene.pose, r_x=math.radians(r_x), r_y=math.radians(r_y), t_x=0.3, t_y=0.1)
        path = tmp_path / f"{r_x}-{r_y}.png"
        writers.write_png(path, replace(scene, pose=pose).render().raw(UNIT))
        before = farm.get(f"cameras/{CAMERA}/pose")["frame"]
        client.send(CAMERA, path, captured=time.time() - BACK_S)
        wait_for(lambda: farm.get(f"cameras/{CAMERA}/pose")["frame"] != before, 60, "the frame does not come")

    return sent


def test_a_turned_camera_is_told_how_far_and_which_way(phone: Visit, farm: Running, send: Send) -> None:
    send(0.0, -9.0)
    page = phone.page
    page.goto(f"{farm.root}/install/{CAMERA}")
    big = page.locator(".install .big")
    big.wait_for()
    assert abs(float(re.search(r"[\d.]+", big.inner_text())[0]) - 9.0) < 0.5
    assert big.bounding_box()["height"] > 48
    assert re.fullmatch(r"Turn [89]\.\d° to the right", page.locator(".install .hint").inner_text().strip())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert pixels.near(pixels.of(page.locator(".target")), "#9a5200", 40) > 100


def test_the_next_frame_changes_it_by_itself(phone: Visit, send: Send) -> None:
    send(8.0, 5.0)
    page = phone.open(f"#/install/{CAMERA}")
    hint = page.locator(".install .hint")
    hint.wait_for()
    assert re.search(r"Tilt \d\.\d° down.*Turn \d\.\d° to the left", " ".join(hint.inner_text().split()))
    send(0.8, -0.5)
    page.get_by_text("Good. Fix it like this.").wait_for()
    assert float(re.search(r"[\d.]+", page.locator(".install .big").inner_text())[0]) < 1.5


def test_a_frame_that_shows_too_little_says_what_to_do(phone: Visit) -> None:
    page = phone.open("#/install/cam-north-1")
    page.locator(".install .hint").wait_for()
    assert "turn the camera" in page.locator(".install .note").inner_text()
    until(page, "document.querySelector('.install img').naturalWidth > 100")


def test_an_unknown_camera_is_said_to_be_none(phone: Visit) -> None:
    page = phone.open("#/install/nobody")
    page.get_by_text("there is no camera 'nobody'").wait_for()

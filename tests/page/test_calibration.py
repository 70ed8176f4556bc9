"""A camera from its first frame on, as the page shows it: gathered, confirmed, moved, calibrated anew, recomputed."""

from __future__ import annotations

import csv
import io
import re
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import silos
from monitor.servers import png, write_site
from page.conftest import CHROMIUM, PAGE, Running, Visit, administer, serving, token, visiting, wait_for
from siloscope.client import Client
from siloscope.simulation import Feed

LEVELS = (0.25, 0.35, 0.45, 0.55, 0.65, 0.3, 0.4, 0.5, 0.6)

LOW = (0.18, 0.22, 0.26, 0.3, 0.2, 0.24, 0.28, 0.32, 0.34)
"""Levels at which enough wall is in view to tell that the camera moved."""

VIEW = "#/silos/silo7/calibration"


MOVED = re.compile(r"^moved .*\d")


class Barn:
    """A service with one camera that has no calibration yet."""

    def __init__(self, running: Running, folder: Path) -> None:
        self.running, self.file = running, folder / "frame.png"
        self.client = Client(running.root, token(running, "camera", "cam7"))
        self.count = 0

    def send(self, levels: tuple[float, ...], *, moved: bool = False) -> None:
        """Frames a minute apart, the last one nearly now."""
        for k, level in enumerate(levels):
            self.count += 1
            scene = silos.noisy(silos.scene(Feed("funnel", level)), 300 + self.count)
            if moved:
                scene = replace(scene, pose=replace(scene.pose, r_x=scene.pose.r_x + 0.05, r_y=scene.pose.r_y - 0.04))
            self.file.write_bytes(png(scene.render().raw(0.001)))
            self.client.send("cam7", self.file, captured=time.time() - 0.2 * (len(levels) - k))

    def camera(self) -> Any:
        return self.running.get("silos/silo7/now")["cameras"][0]

    def runs(self) -> list[dict[str, Any]]:
        return list(self.running.get("silos/silo7/runs")["items"])


@pytest.fixture(scope="module")
def barn(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Barn]:
    if CHROMIUM is None or not (PAGE / "index.html").is_file():
        pytest.skip("chromium or the built page is missing: make services, make page")
    folder = tmp_path_factory.mktemp("barn")
    site = write_site(folder / "site", calibrated=False)
    with serving(folder / "data", "--site", str(site)) as running:
        yield Barn(running, folder)


@pytest.fixture
def visit(chromium: Any, barn: Barn) -> Iterator[Visit]:
    with visiting(chromium, barn.running.root) as one:
        yield one
        assert one.errors == []


def confirmed(visit: Visit) -> None:
    """Waits for a proposal on the page, confirms it, and waits until it is in force."""
    page = visit.page
    page.get_by_role("button", name="Use it").wait_for(timeout=90_000)
    page.get_by_role("button", name="Use it").click()
    page.get_by_role("button", name="Use it").wait_for(state="detached", timeout=60_000)


def test_frames_gather_into_a_calibration_that_a_person_confirms(barn: Barn, visit: Visit) -> None:
    page = visit.open(VIEW)
    page.get_by_text("There is no calibration yet.").wait_for()
    barn.send(LEVELS)
    confirmed(visit)
    page.get_by_text(re.compile("from gathered frames")).wait_for()
    wait_for(lambda: len(barn.running.get("silos/silo7/readings")["items"]) == len(LEVELS), 120, "no readings come")
    visit.open("")
    page.wait_for_selector(".card .share")
    assert re.search(r"\d+\s?%", page.locator(".card").inner_text())


def test_a_moved_camera_opens_a_new_calibration(barn: Barn, visit: Visit) -> None:
    page = visit.open(VIEW)
    barn.send(LOW[:4], moved=True)
    wait_for(lambda: barn.camera()["moved_since"], 120, "the move is not noticed")
    barn.send(LOW, moved=True)
    page.get_by_text(MOVED).first.wait_for(timeout=120_000)
    confirmed(visit)
    page.get_by_text(re.compile("after the camera moved")).wait_for()
    ends = [row["valid_to"] for row in barn.running.get("silos/silo7/calibrations")["items"]]
    assert sorted(end is None for end in ends) == [False, True], "the one before ends where the new one begins"
    assert page.get_by_text(MOVED).count() == 0


def test_recomputation_keeps_the_old_run(barn: Barn, visit: Visit) -> None:
    page = visit.open(VIEW)
    page.get_by_role("heading", name="Runs").wait_for()
    before = {run["id"]: run["current"] for run in barn.runs()}
    secret = administer("token", "--data", str(barn.running.data), "--role", "admin").split()[0]
    asked = Client(barn.running.root, secret).send_document("POST", "/api/v1/silos/silo7/calibration:recompute", {})
    wait_for(lambda: any(run["id"] == asked["run"] and run["current"] == asked["frames"] for run in barn.runs()), 120,
             "the new run does not come")  # fmt: skip
    runs = page.get_by_role("region", name="Runs").locator("li")
    page.get_by_text(f"{asked['frames']} readings count, 0 were replaced").wait_for()
    assert runs.count() == len(before) + 1
    assert "measured anew" in runs.first.inner_text()
    assert all(run["current"] == 0 for run in barn.runs() if run["id"] in before)
    assert "replaced" in runs.nth(1).inner_text()
    link = runs.nth(1).get_by_role("link", name="CSV").evaluate("link => link.href")
    with urllib.request.urlopen(link) as answer:
        rows = list(csv.DictReader(io.StringIO(answer.read().decode())))
    assert len(rows) > 0
    assert {int(row["run"]) for row in rows} <= set(before)

"""Under a strict policy, below a sub-path, with the link lost, in four languages, by keyboard, by screen reader."""

from __future__ import annotations

import gzip
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from page.conftest import AXE, DESK, PAGE, PHONE, Running, Visit, grave, visiting
from wire import Wire

LARGEST = 180_000
"""Bytes of the whole page, compressed."""

VIEWS = ("", "#/silos/north-1", "#/silos/north-1/rules", "#/silos/north-1/calibration", "#/alerts", "#/cameras")

READY = {"": ".card", "#/alerts": "h1", "#/cameras": "h1"}


def ready(page: Any, view: str) -> None:
    """Waits until a view stands."""
    page.wait_for_selector(READY.get(view, "[role=tabpanel]"))
    if "silos/" in view:
        page.wait_for_selector("canvas.solid[data-drawn]")


def test_the_page_is_small_and_names_nobody_else() -> None:
    files = [file for file in PAGE.rglob("*") if file.is_file() and file.name != "LICENSES.txt"]
    size = sum(len(gzip.compress(file.read_bytes(), 9)) for file in files)
    assert size <= LARGEST, f"{size} bytes"
    index = (PAGE / "index.html").read_text()
    assert not re.search(r'(src|href)="(https?:)?/', index), "addresses are relative"
    assert not re.search(r"<script(?![^>]*src=)|<style|style=|onload=", index), "nothing inline"


def test_three_comes_with_the_first_silo_only(visit: Visit) -> None:
    asked: list[str] = []
    visit.page.on("request", lambda request: asked.append(request.url))
    page = visit.open()
    ready(page, "")
    page.wait_for_timeout(300)
    assert not any("/view-" in url for url in asked)
    page.get_by_role("link", name="North 1").click()
    ready(page, "#/silos/north-1")
    assert any("/view-" in url for url in asked)


def test_the_policy_is_strict_and_kept(visit: Visit) -> None:
    answer = visit.page.goto(visit.root)
    policy = answer.headers["content-security-policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";") if " " in rule.strip())
    assert rules["script-src"] == "'self'"
    assert rules["style-src"] == "'self'"
    for view in VIEWS:
        ready(visit.open(view), view)


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_axe_finds_nothing_serious(chromium: Any, farm: Running, theme: str, size: dict[str, int]) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is missing: make page")
    with visiting(chromium, farm.root, color_scheme=theme, viewport=size) as visit:
        for view in (*VIEWS, "#/install/cam-north-1"):
            page = visit.open(view)
            if "install" in view:
                page.wait_for_selector(".install")
            else:
                ready(page, view)
            assert grave(page) == [], view


def test_all_is_reached_by_keyboard(visit: Visit) -> None:
    page = visit.open()
    ready(page, "")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to content"
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
    reached = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.textContent.trim()"))
        if page.evaluate("document.activeElement.textContent") == "North 3":
            break
    assert {"North 1", "North 2", "North 3"} <= reached
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="North 3").wait_for()
    page.get_by_role("tab", name="Events").focus()
    page.keyboard.press("ArrowRight")
    page.get_by_role("tab", name="Tickets", selected=True).wait_for()
    assert page.evaluate("document.activeElement.textContent") == "Tickets"
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    page.get_by_role("tab", name="Rules", selected=True).wait_for()


ENGLISH = re.compile(r"\b(Empty|Refill|Surface|Trend|Height|Acknowledge|since|ago)\b")

LANGUAGES = {
    "en": ("English", "All silos", "Empty by", "."),
    "es": ("Español", "Todos los silos", "Vacío el", ","),
    "ca": ("Català", "Totes les sitges", "Buida el", ","),
    "de": ("Deutsch", "Alle Silos", "Leer am", ","),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_language_is_spoken_throughout(chromium: Any, farm: Running, language: str) -> None:
    name, title, word, point = LANGUAGES[language]
    with visiting(chromium, farm.root, locale="fr-FR") as visit:
        page = visit.open()
        ready(page, "")
        page.get_by_role("combobox").last.select_option(label=name)
        page.get_by_role("heading", name=title).wait_for()
        assert page.evaluate("document.documentElement.lang").startswith(language)
        text = page.locator(".cards").inner_text()
        assert word in text
        assert re.search(rf"\d\{point}\d", text)
        page.reload()
        page.get_by_role("heading", name=title).wait_for()
        if language != "en":
            for view in VIEWS:
                ready(visit.open(view), view)
                spoken = page.locator("main, header").all_inner_texts()
                left = re.findall(
                    r"\b(Silos? of|Empty|Refill|Surface|Trend|Height|Acknowledge|since|ago)\b", " ".join(spoken)
                )
                assert left == [], view


@contextmanager
def nginx(root: str, folder: Path) -> Iterator[str]:
    """nginx in front of a service, below /barn/monitor/."""
    binary = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    if binary is None:
        pytest.skip("nginx is missing: make services")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    temporary = "\n".join(
        f"{name}_temp_path {folder}/{name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (folder / "nginx.conf").write_text(f"""
        daemon off; pid {folder}/pid; error_log {folder}/error.log; worker_processes 1;
        events {{ worker_connections 64; }}
        http {{
            access_log off; {temporary}
            server {{
                listen 127.0.0.1:{port};
                location /barn/monitor/ {{
                    proxy_pass {root}/;
                    proxy_set_header Host $http_host;
                    proxy_set_header X-Forwarded-Host $http_host;
                    proxy_http_version 1.1;
                    proxy_buffering off;
                }}
            }}
        }}""")
    process = subprocess.Popen([binary, "-c", f"{folder}/nginx.conf", "-e", f"{folder}/error.log"])
    try:
        address = f"http://127.0.0.1:{port}/barn/monitor"
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield address
    finally:
        process.terminate()
        process.wait(10)


def test_it_works_below_a_sub_path(chromium: Any, farm: Running, tmp_path: Path) -> None:
    asked: list[str] = []
    with nginx(farm.root, tmp_path) as root, visiting(chromium, root) as visit:
        visit.page.on("request", lambda request: asked.append(request.url))
        for view in VIEWS:
            ready(visit.open(view), view)
        visit.page.goto(f"{root}/install/cam-north-1")
        visit.page.wait_for_selector(".install")
        assert visit.page.url.startswith(f"{root}/")
        assert f"{root}/api/v1/events" in asked
        assert all(url.startswith(f"{root}/") for url in asked)
        assert visit.errors == []
        assert visit.foreign == []


def test_a_lost_link_blanks_nothing_and_comes_back(chromium: Any, farm: Running) -> None:
    wire = Wire(farm.root)
    try:
        with visiting(chromium, wire.root) as visit:
            page = visit.open()
            ready(page, "")
            page.wait_for_timeout(1500)
            before = page.locator(".card .share").all_inner_texts()
            wire.cut()
            page.get_by_text("No connection").wait_for()
            assert page.locator(".card .share").all_inner_texts() == before
            assert "loaded" in page.locator(".lost").inner_text()
            page.get_by_role("link", name="Alerts").click()
            page.get_by_role("link", name="Silos", exact=True).click()
            page.get_by_role("heading", name="All silos").wait_for()
            assert page.locator(".card").count() == 6, "views that were seen stay"
            wire.sent.clear()
            wire.mend()
            page.get_by_text("No connection").wait_for(state="detached", timeout=45_000)
            asked = wire.asked(b"get /api/v1/silos ", page)
            assert re.search(rb"get /api/v1/events http.*?last-event-id: \d+", asked, re.DOTALL)
            assert b"get /api/v1/silos " in asked, "what was missed is fetched"
    finally:
        wire.close()


def test_a_page_that_can_not_reach_the_service_says_so(chromium: Any, farm: Running) -> None:
    with visiting(chromium, farm.root) as visit:
        visit.page.route("**/api/v1/**", lambda route: route.abort())
        page = visit.open()
        page.get_by_text("can't be reached").wait_for()
        visit.page.unroute("**/api/v1/**")
        ready(page, "")

"""A browser and a running service for the tests of the page; skipped where chromium or the built page is missing."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="the page's tests need playwright")
pytest.importorskip("fastapi", reason="the page's tests need the extra [monitor]")

import siloscope  # noqa: E402

PAGE = Path(siloscope.__file__).parent / "monitor" / "page"

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

WITHOUT_WEBGL = ("--disable-gpu", "--disable-3d-apis", "--disable-software-rasterizer")

PHONE, DESK = {"width": 390, "height": 844}, {"width": 1280, "height": 860}

BREACH = re.compile("CSP |Content.Security.Policy")
"""What the browser writes where the policy is broken."""

DRIVEN = "cam-south-1"
"""The company drives this camera, of which nothing comes."""

READY_S = 240.0
"""How long the simulated farm may take to be made on a busy machine."""


@dataclass(frozen=True)
class Running:
    """A service that answers."""

    root: str
    data: Path
    link: str | None
    """Where the first user is made."""

    def get(self, path: str, token: str | None = None) -> Any:
        """An answer of its interface."""
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        with urllib.request.urlopen(urllib.request.Request(f"{self.root}/api/v1/{path}", headers=headers)) as answer:
            return json.load(answer)


@contextmanager
def serving(data: Path, *options: str) -> Iterator[Running]:
    """A service on a free port, ended at the end."""
    command = [sys.executable, "-m", "siloscope", "serve", "--data", str(data), "--bind", "127.0.0.1:0", *options]
    told = data.with_suffix(".log")
    with told.open("w") as log:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            assert process.stdout is not None
            root = process.stdout.readline().strip()
            assert root, told.read_text()
            wait_for(lambda: _answers(root), READY_S, "the service does not answer")
            links = [word for word in told.read_text().split() if "/welcome#" in word]
            yield Running(root, data, links[0] if links else None)
        finally:
            process.terminate()
            process.wait(30)


def _answers(root: str) -> bool:
    try:
        with urllib.request.urlopen(f"{root}/healthz", timeout=5):
            return True
    except OSError:
        return False


def token(running: Running, role: str, camera: str) -> str:
    """A new token, by the command line."""
    return administer("token", "--data", str(running.data), "--role", role, "--camera", camera).split()[0]


def administer(*arguments: str) -> str:
    """What a command of `siloscope monitor` prints."""
    command = [sys.executable, "-m", "siloscope", "monitor", *arguments]
    made = subprocess.run(command, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return made.stdout


def wait_for(true: Any, seconds: float, otherwise: str) -> None:
    """Waits until something holds."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            pytest.fail(otherwise)
        time.sleep(0.2)


def until(page: Any, expression: str, seconds: float = 30.0) -> None:
    """Waits until an expression holds in the page. Playwright's own way needs `eval`, which the policy forbids."""
    wait_for(lambda: page.evaluate(expression), seconds, f"it never becomes true: {expression}")


def grave(page: Any) -> list[tuple[str, str, str]]:
    """What axe finds serious or critical in a page as it stands: rule, element, what to do."""
    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run()")
    assert len(found["passes"]) > 10
    return [
        (one["id"], one["nodes"][0]["html"][:200], one["nodes"][0]["failureSummary"])
        for one in found["violations"]
        if one["impact"] in ("serious", "critical")
    ]


@pytest.fixture(scope="session")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """The simulated farm, to which this machine is let in without a login."""
    if not (PAGE / "index.html").is_file():
        pytest.skip("the page is not built: make page")
    if CHROMIUM is None:
        pytest.skip("chromium is missing: make services")
    with serving(tmp_path_factory.mktemp("farm") / "data", "--demo") as running:
        yield running


@pytest.fixture(scope="session")
def company(farm: Running, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A copy of the farm without its cameras, for tests that make users."""
    data = tmp_path_factory.mktemp("company") / "data"
    data.mkdir()
    with sqlite3.connect(farm.data / "siloscope.db") as source, sqlite3.connect(data / "siloscope.db") as target:
        source.backup(target)
    shutil.copytree(farm.data / "frames", data / "frames")
    with serving(data, "--live", f"{DRIVEN}=folder:{data.parent / 'none'}") as running:
        yield running


@dataclass
class Visit:
    """One browser window with what went wrong in it."""

    page: Any
    root: str
    foreign: list[str] = field(default_factory=list)
    """Requests to other hosts; they are blocked."""
    errors: list[str] = field(default_factory=list)
    """Uncaught errors and breaches of the content security policy."""

    def open(self, where: str = "") -> Any:
        """Goes to an address of the page."""
        self.page.goto(f"{self.root}/{where}")
        return self.page


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """The browser; its WebGL is drawn by the processor."""
    with playwright.sync_playwright() as driver:
        arguments = ["--enable-unsafe-swiftshader"]
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=arguments)
        browser.driver = driver
        yield browser
        browser.close()


@contextmanager
def visiting(browser: Any, root: str, **settings: Any) -> Iterator[Visit]:
    """A window that can reach this machine alone."""
    options = {"viewport": DESK, "locale": "en-GB", "timezone_id": "Europe/Madrid", "reduced_motion": "reduce"}
    context = browser.new_context(**{**options, **settings})
    context.set_default_timeout(30_000)
    visit = Visit(context.new_page(), root)

    def route(handler: Any) -> None:
        host = handler.request.url.split("/")[2].split(":")[0]
        if host in ("127.0.0.1", "localhost"):
            handler.continue_()
        else:
            visit.foreign.append(handler.request.url)
            handler.abort()

    context.route(lambda url: not url.startswith(("data:", "blob:")), route)
    context.add_init_script(
        "document.addEventListener('securitypolicyviolation', (e) => console.error('CSP ' + e.violatedDirective))"
    )
    visit.page.on("pageerror", lambda error: visit.errors.append(str(error)))
    visit.page.on(
        "console",
        lambda line: visit.errors.append(line.text) if "CSP" in line.text or "Content Security" in line.text else None,
    )
    try:
        yield visit
    finally:
        context.close()


@pytest.fixture
def visit(chromium: Any, farm: Running) -> Iterator[Visit]:
    """A window on a desk; at the end nothing foreign was asked for and nothing failed."""
    with visiting(chromium, farm.root) as one:
        yield one
        assert one.foreign == []
        assert one.errors == []


@pytest.fixture
def phone(chromium: Any, farm: Running) -> Iterator[Visit]:
    """The same on a phone."""
    with visiting(chromium, farm.root, viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2) as one:
        yield one
        assert one.foreign == []
        assert one.errors == []


PASSWORD = "correct horse battery"


@pytest.fixture(scope="session")
def admin(chromium: Any, company: Running) -> Any:
    """The first user, made by the one-time link; the cookies of the session."""
    with visiting(chromium, company.root) as visit:
        visit.page.goto(company.link)
        page = visit.page
        page.get_by_label("Name").fill("Anna")
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("button", name="Set password").click()
        page.wait_for_selector(".card")
        assert visit.errors == []
        return visit.page.context.storage_state()


def signed_in(browser: Any, company: Running, state: Any, **settings: Any) -> Any:
    """A window of somebody who is signed in."""
    return visiting(browser, company.root, storage_state=state, **settings)

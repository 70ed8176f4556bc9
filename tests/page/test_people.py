"""The first user, signing in and out, what each role sees, people and tokens."""

from __future__ import annotations

import re
from typing import Any

import pytest

from page.conftest import AXE, DESK, DRIVEN, PASSWORD, PHONE, Running, grave, signed_in, visiting


def test_without_a_login_there_is_only_the_login(chromium: Any, company: Running, admin: Any) -> None:
    with visiting(chromium, company.root) as visit:
        page = visit.open()
        page.get_by_role("heading", name="Sign in").wait_for()
        assert page.locator(".card").count() == 0
        page.get_by_label("Name").fill("Anna")
        page.get_by_label("Password").fill("wrong password")
        page.get_by_role("button", name="Sign in").click()
        page.get_by_role("alert").wait_for()
        assert page.get_by_role("alert").inner_text() == "Name or password is not right."
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("button", name="Sign in").click()
        page.wait_for_selector(".card")
        page.get_by_role("button", name="Sign out Anna").click()
        page.get_by_role("heading", name="Sign in").wait_for()


def invited(chromium: Any, company: Running, admin: Any, name: str, role: str) -> str:
    """Invites somebody on the settings page; the link."""
    with signed_in(chromium, company, admin) as visit:
        page = visit.open("#/settings")
        people = page.get_by_role("region", name="People")
        people.get_by_label("Name").fill(name)
        people.get_by_label("May").select_option(label=role)
        people.get_by_role("button", name="Invite").click()
        link = people.locator(".secret")
        link.wait_for()
        assert visit.errors == []
        return str(link.inner_text())


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_axe_finds_nothing_serious_on_people(
    chromium: Any, company: Running, admin: Any, theme: str, size: dict[str, int]
) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is missing: make page")
    settings = {"storage_state": admin, "color_scheme": theme, "viewport": size}
    with visiting(chromium, company.root, **settings) as visit:
        page = visit.open("#/settings")
        page.get_by_role("region", name="People").wait_for()
        assert grave(page) == []
        page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]


def test_the_lowest_role_sees_percent_and_nothing_else(chromium: Any, company: Running, admin: Any) -> None:
    link = invited(chromium, company, admin, "Producer", "see percent only")
    with visiting(chromium, company.root) as visit:
        page = visit.page
        page.goto(link)
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("button", name="Set password").click()
        page.wait_for_selector(".card")
        told = page.locator("main").inner_text()
        assert re.search(r"\d+\s?%", told)
        assert not re.search(r"\d (t|kg|m³)\b", told)
        assert page.get_by_role("link", name="Settings").count() == 0
        page.get_by_role("link", name="North 1", exact=True).click()
        page.wait_for_selector(".trend canvas")
        told = page.locator("main").inner_text()
        assert not re.search(r"\d (t|kg|m³|m|mm)\b", told), told
        assert page.get_by_role("tab").count() == 0
        assert page.locator("canvas.solid").count() == 0
        assert visit.errors == []


def test_a_token_is_shown_once_and_works_until_revoked(chromium: Any, company: Running, admin: Any) -> None:
    with signed_in(chromium, company, admin) as visit:
        page = visit.open("#/settings")
        tokens = page.get_by_role("region", name="Tokens")
        tokens.get_by_label("For").select_option(label="reading")
        tokens.get_by_label("Label").fill("report")
        tokens.get_by_role("button", name="Make a token").click()
        secret = tokens.locator(".secret")
        secret.wait_for()
        assert len(company.get("silos", secret.inner_text())["items"]) == 6
        page.reload()
        row = tokens.get_by_role("listitem").filter(has_text="report")
        row.wait_for()
        assert tokens.locator(".secret").count() == 0
        row.get_by_role("button", name="Revoke").click()
        row.wait_for(state="detached")


def test_a_person_is_locked_out(chromium: Any, company: Running, admin: Any) -> None:
    invited(chromium, company, admin, "Former", "see all")
    with signed_in(chromium, company, admin) as visit:
        page = visit.open("#/settings")
        page.get_by_role("button", name="Lock out Former").click()
        page.get_by_role("listitem").filter(has_text="Former").get_by_text("locked out").wait_for()


def test_a_camera_that_the_service_drives_says_why_it_gives_nothing(
    chromium: Any, company: Running, admin: Any
) -> None:
    with signed_in(chromium, company, admin) as visit:
        row = visit.open("#/cameras").get_by_role("listitem").filter(has_text=DRIVEN)
        row.get_by_text("gives no frames").wait_for()
        assert "No such file or directory" in row.inner_text()
        page = visit.open(f"#/install/{DRIVEN}")
        page.get_by_text("No such file or directory").wait_for()
        assert visit.errors == []

"""The first view: every silo's card, the tree, alerts, late marks; on a desk and on a phone."""

from __future__ import annotations

import re
from typing import Any

from page import pixels
from page.conftest import Running, Visit


def cards(page: Any) -> Any:
    """The cards, once the first has come."""
    page.wait_for_selector(".card")
    return page.locator(".card")


def card(page: Any, name: str) -> Any:
    """The card of a silo."""
    return page.locator(".card", has=page.get_by_role("link", name=name, exact=True))


def shown(page: Any, name: str) -> int:
    """The percentage on a silo's card, a quarter of a second later: a reading may come between page and question."""
    page.wait_for_timeout(250)
    return int(re.search(r"(\d+)\s?%", card(page, name).inner_text())[1])


def now(farm: Running, silo: str) -> float:
    """The silo's newest filling, percent."""
    return 100.0 * farm.get(f"silos/{silo}/now")["fill_fraction"]


def test_every_silo_has_a_card_with_its_numbers(visit: Visit, farm: Running) -> None:
    page = visit.open()
    silos = farm.get("silos")["items"]
    assert cards(page).count() == len(silos) == 6
    for silo in silos:
        text = card(page, silo["name"]).inner_text()
        assert any(abs(shown(page, silo["name"]) - now(farm, silo["id"])) <= 1.0 for _ in range(20)), text
        assert re.search(r"\d plus or minus ± \d+(\.\d+)? (t|kg)", " ".join(text.split())), text


def test_the_section_is_filled_as_far_as_the_silo(visit: Visit, farm: Running) -> None:
    page = visit.open()
    cards(page)
    filled = {}
    for silo in farm.get("silos")["items"]:
        seen = pixels.of(card(page, silo["name"]).locator("svg.section"))
        rows = [pixels.near(seen[row : row + 1], "#d99f3d") > 12 for row in range(len(seen))]
        if silo["now"]["stale"]:
            continue
        filled[silo["now"]["fill_fraction"]] = sum(rows) / len(rows)
    assert len(filled) >= 4
    pairs = [(low, high) for low in filled for high in filled if high - low > 0.1]
    assert pairs
    assert all(filled[low] < filled[high] for low, high in pairs)


def test_a_silent_camera_is_late_and_raises_an_alert(visit: Visit) -> None:
    page = visit.open()
    cards(page)
    late = page.locator(".card", has=page.locator(".badge", has_text="LATE"))
    assert late.count() == 1
    assert "No readings" in late.inner_text()
    assert re.search(r"\d+ hours ago", late.inner_text())


def test_the_tree_chooses_a_place(visit: Visit) -> None:
    page = visit.open()
    cards(page)
    page.get_by_role("navigation", name="Places").get_by_role("link", name=re.compile("North barn")).click()
    page.get_by_role("heading", name="North barn").wait_for()
    assert page.locator(".card").count() == 3
    page.go_back()
    page.get_by_role("heading", name="All silos").wait_for()
    assert page.locator(".card").count() == 6


def test_a_phone_shows_all_without_scrolling_sideways(phone: Visit) -> None:
    page = phone.open()
    cards(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert not page.locator("nav.tree").is_visible()
    page.locator("select.places").select_option(label="\u2003\u2003South barn")
    page.get_by_role("heading", name="South barn").wait_for()
    assert page.locator(".card").count() == 3
    buttons = page.locator("a:visible:not(h2 a), button:visible, select:visible")  # a card's link is the whole card
    small = [one.inner_text() for one in buttons.all() if (one.bounding_box() or {"height": 99})["height"] < 24]
    assert small == [], "too small for a thumb"


def test_an_alert_is_acknowledged_once_and_seen_at_once(visit: Visit, farm: Running) -> None:
    page = visit.open()
    cards(page)
    before = [alert for alert in farm.get("alerts?state=firing")["items"] if not alert["acknowledged"]]
    page.locator(".card").get_by_role("button", name=re.compile("Acknowledge.*No readings")).click()
    page.get_by_text(re.compile("seen by")).first.wait_for()
    after = [alert for alert in farm.get("alerts?state=firing")["items"] if not alert["acknowledged"]]
    gone = {alert["id"] for alert in before} - {alert["id"] for alert in after}
    assert len(gone) == 1
    page.get_by_role("link", name=re.compile("^Alerts")).click()
    page.get_by_role("heading", name="Alerts").wait_for()
    assert "seen by" in page.locator("main").inner_text()

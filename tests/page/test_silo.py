"""One silo: the surface in three dimensions, the trend, and what belongs to them, by the pixels that are drawn."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from page import pixels
from page.conftest import CHROMIUM, WITHOUT_WEBGL, Running, Visit, until, visiting

ACCENT = "#24614c"


def surface(page: Any) -> Any:
    """The drawn surface."""
    page.wait_for_selector("canvas.solid[data-drawn]")
    return page.locator("canvas.solid")


def trend(page: Any) -> Any:
    """The trend, once its line is drawn."""
    plot = page.locator(".trend canvas")
    plot.wait_for()
    until(page, "document.querySelector('.trend').ariaLabel.includes('now')")
    page.wait_for_timeout(300)
    return plot


def settled(page: Any, act: Any) -> None:
    """Does something and waits until the surface is drawn again."""
    count = page.locator("canvas.solid").get_attribute("data-drawn")
    act()
    until(page, f"document.querySelector('canvas.solid').dataset.drawn > {count}")


def test_the_surface_is_drawn_and_turns(visit: Visit) -> None:
    page = visit.open("#/silos/north-1")
    canvas = surface(page)
    front = pixels.of(canvas)
    assert pixels.colours(front) > 1000
    assert pixels.near(front, "#c99440", 60) > 3000, "the content's side"
    canvas.focus()
    settled(page, lambda: [page.keyboard.press("ArrowUp") for _ in range(6)])
    assert pixels.different(front, pixels.of(canvas)) > 0.05


def test_the_colours_tell_height_deviation_or_seen(visit: Visit) -> None:
    page = visit.open("#/silos/north-1")
    canvas = surface(page)
    pictures = [pixels.of(canvas)]
    for name in ("Deviation", "Seen"):
        settled(page, lambda name=name: page.get_by_text(name, exact=True).first.click())
        pictures.append(pixels.of(canvas))
    assert all(pixels.different(a, b) > 0.02 for k, a in enumerate(pictures) for b in pictures[k + 1 :])
    assert "not seen" in page.locator(".legend").first.inner_text()


def test_a_lower_silo_is_drawn_lower(visit: Visit, farm: Running) -> None:
    tops = {}
    for silo in ("north-1", "south-1"):
        seen = pixels.of(surface(visit.open(f"#/silos/{silo}")))
        rows = np.flatnonzero([pixels.near(seen[row : row + 1], "#c99440", 50) > 20 for row in range(len(seen))])
        tops[silo] = rows[0] / len(seen)
        visit.page.goto("about:blank")
    fill = {silo["id"]: silo["now"]["fill_fraction"] for silo in farm.get("silos")["items"]}
    assert (tops["north-1"] < tops["south-1"]) == (fill["north-1"] > fill["south-1"])


def test_the_trend_has_line_band_refills_and_forecast(visit: Visit, farm: Running) -> None:
    page = visit.open("#/silos/north-1")
    seen = pixels.of(trend(page))
    assert pixels.near(seen, ACCENT, 40) > 400, "the line"
    assert pixels.near(seen, "#2c7a58", 12) > 30, "the refills' marks"
    right = seen[:, int(0.8 * seen.shape[1]) :]
    assert 20 < pixels.near(right, ACCENT, 60) < 1000, "the forecast"
    count = sum(event["kind"] == "refill" for event in farm.get("silos/north-1/events?count=1000")["items"])
    label = page.locator(".trend").get_attribute("aria-label")
    assert int(re.search(r"(\d+) refill", label)[1]) <= count
    page.get_by_role("button", name="Year", exact=True).click()
    page.wait_for_timeout(1500)
    assert pixels.different(seen, pixels.of(page.locator(".trend canvas"))) > 0.02


def test_a_gap_is_hatched_not_bridged(visit: Visit) -> None:
    page = visit.open("#/silos/south-1")
    page.get_by_role("button", name="7 days").click()
    until(page, "/[1-9] gap/.test(document.querySelector('.trend').ariaLabel)")
    page.wait_for_timeout(300)
    seen = pixels.of(page.locator(".trend canvas"))
    now = int(0.70 * seen.shape[1])
    gap = seen[:, now - 30 : now]
    assert pixels.near(gap, ACCENT, 30) < 15, "no line"
    assert pixels.colours(gap) > 8
    assert pixels.near(gap, "#c9c8c1", 40) > 100, "hatching"


def test_the_table_says_the_same_as_the_trend(visit: Visit, farm: Running) -> None:
    page = visit.open("#/silos/south-2")
    trend(page)
    page.get_by_text("The same as a table").click()
    first = page.locator("details tbody tr").first.inner_text()
    mass = farm.get("silos/south-2/now")["mass_kg"] / 1000
    assert abs(float(re.search(r"([\d.]+) t", first)[1]) - mass) < 0.15


def test_going_back_in_time_shows_an_older_surface(visit: Visit) -> None:
    page = visit.open("#/silos/north-1")
    canvas = surface(page)
    now = pixels.of(canvas)
    slider = page.get_by_role("slider")
    settled(page, lambda: slider.fill("-20"))
    assert (
        "Oct" in page.locator(".surface").locator("..").inner_text() or pixels.different(now, pixels.of(canvas)) > 0.01
    )


def test_the_tabs_hold_events_tickets_calibration_and_rules(visit: Visit) -> None:
    page = visit.open("#/silos/north-1")
    page.get_by_role("tab", name="Events").wait_for()
    page.get_by_role("cell", name="Refill").first.wait_for()
    page.get_by_role("tab", name="Rules").click()
    page.get_by_role("rowheader", name="Nearly empty").wait_for()
    page.get_by_role("tab", name="Calibration").click()
    page.get_by_text("In force").wait_for()
    page.get_by_role("tab", name="Tickets").click()
    page.get_by_text("No ticket has been entered.").wait_for()


def test_a_ticket_is_entered(visit: Visit, farm: Running) -> None:
    page = visit.open("#/silos/south-3/tickets")
    page.get_by_label("Time").last.fill("2026-11-20T10:30")
    page.get_by_label("Weight").fill("6.25")
    page.get_by_label("Number").fill("W-1234")
    page.get_by_role("button", name="Add ticket").click()
    row = page.get_by_role("row", name=re.compile("W-1234"))
    row.wait_for()
    assert "6.3 t" in row.inner_text() or "6.25 t" in row.inner_text()
    assert [one["mass_kg"] for one in farm.get("silos/south-3/tickets")["items"]] == [6250.0]


def test_the_cameras_picture_is_shown(visit: Visit) -> None:
    page = visit.open("#/silos/north-1")
    picture = page.locator("img.picture")
    picture.scroll_into_view_if_needed()
    until(page, "document.querySelector('img.picture').naturalWidth > 100")
    assert pixels.colours(pixels.of(picture)) > 50


def test_without_webgl_a_map_stands_in_and_the_trend_stays(chromium: Any, farm: Running) -> None:
    browser = chromium.driver.chromium.launch(executable_path=CHROMIUM, args=list(WITHOUT_WEBGL))
    try:
        with visiting(browser, farm.root) as visit:
            page = visit.open("#/silos/north-1")
            page.locator("canvas.flat").wait_for()
            assert page.evaluate("document.createElement('canvas').getContext('webgl2') === null")
            page.wait_for_timeout(300)
            assert pixels.colours(pixels.of(page.locator("canvas.flat"))) > 100
            assert pixels.near(pixels.of(trend(page)), ACCENT, 40) > 400
            assert "from above" in page.locator("main").inner_text()
            assert visit.errors == []
    finally:
        browser.close()


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_screen(chromium: Any, farm: Running, width: int) -> None:
    with visiting(chromium, farm.root, viewport={"width": width, "height": 844}) as visit:
        page = visit.open("#/silos/north-1")
        surface(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_the_surface_is_whole_below_the_bars_of_a_phone(phone: Visit) -> None:
    """An opaque bar over the canvas's lower end must not cost its upper one."""
    page = phone.open("#/silos/north-2")
    canvas = page.locator("canvas.solid[data-drawn]")
    canvas.wait_for()
    top = canvas.bounding_box()["y"]
    rows = []
    for shown in (844 - 300, 200):  # 62 of its 320 pixels below the lower bar; none
        page.evaluate(f"window.scrollTo(0, {top - shown})")
        page.wait_for_timeout(500)
        box = canvas.bounding_box()
        clip = {"x": box["x"], "y": box["y"], "width": box["width"], "height": 60}
        rows.append(pixels.shot(page, clip))
    assert pixels.colours(rows[1]) > 20
    assert pixels.different(*rows) < 0.02

"""What an administrator changes on the page: rules, product and density, names, lengths, cameras, roles, tickets."""

from __future__ import annotations

from typing import Any

import pytest

from page.conftest import AXE, DESK, PHONE, Running, Visit, administer, grave, signed_in, until, wait_for

SILO = "north-1"


@pytest.fixture(scope="module")
def key(company: Running, admin: Any) -> str:
    """A token that reads what the page has changed."""
    return administer("token", "--data", str(company.data), "--role", "admin").split()[0]


def rules_of(company: Running, key: str, kind: str) -> dict[str | None, Any]:
    """Rules of a kind by the silo that they are for."""
    return {one["silo"]: one for one in company.get("rules", key)["items"] if one["kind"] == kind}


def change(area: Any, name: str, **entries: str) -> None:
    """Opens a form, fills it, saves it, and waits for the word that it is saved."""
    area.locator("summary", has_text=name).click()
    for label, value in entries.items():
        area.get_by_label(label.replace("_", " ")).fill(value)
    area.get_by_role("button", name="Save").click()
    area.get_by_text("Saved.").wait_for()


def test_a_rule_becomes_the_silos_own_and_general_again(chromium: Any, company: Running, admin: Any, key: str) -> None:
    before = rules_of(company, key, "low")
    assert list(before) == [None]
    with signed_in(chromium, company, admin, viewport=PHONE) as visit:
        panel = visit.open(f"#/silos/{SILO}/rules").get_by_role("tabpanel")
        panel.get_by_label("Rule to change").select_option(label="Low")
        change(panel, "Change Low", Begins_at="29", Ends_at="33.5", Delay="10")
        own = rules_of(company, key, "low")[SILO]
        assert (own["level"], own["clear"], own["delay_s"]) == (0.29, 0.335, 600)
        assert rules_of(company, key, "low")[None] == before[None]
        panel.get_by_role("row", name="Low this silo's own").wait_for()
        panel.locator("summary", has_text="Change Low").click()
        panel.get_by_role("checkbox", name="on").uncheck()
        panel.get_by_role("button", name="Save").click()
        panel.get_by_role("row", name="Low off").wait_for()
        panel.get_by_role("button", name="Use the general rule again").click()
        panel.get_by_role("button", name="Use the general rule again").wait_for(state="detached")
        assert rules_of(company, key, "low") == before
        assert visit.errors == []


def test_levels_that_contradict_each_other_are_refused_with_the_reason(
    chromium: Any, company: Running, admin: Any, key: str
) -> None:
    with signed_in(chromium, company, admin) as visit:
        panel = visit.open(f"#/silos/{SILO}/rules").get_by_role("tabpanel")
        panel.get_by_label("Rule to change").select_option(label="Nearly empty")
        panel.locator("summary", has_text="Change").click()
        panel.get_by_label("Begins at").fill("50")
        panel.get_by_label("Ends at").fill("20")
        panel.get_by_role("button", name="Save").click()
        panel.get_by_role("alert").wait_for()
        assert "would end before it begins" in panel.get_by_role("alert").inner_text()
        assert panel.get_by_label("Begins at").input_value() == "50", "what was typed stays"
        assert list(rules_of(company, key, "critical")) == [None]


def test_a_general_rule_is_changed_for_all_silos(chromium: Any, company: Running, admin: Any, key: str) -> None:
    with signed_in(chromium, company, admin) as visit:
        panel = visit.open(f"#/silos/{SILO}/rules").get_by_role("tabpanel")
        panel.get_by_label("Rule to change").select_option(label="No readings")
        panel.locator("summary", has_text="Change").click()
        panel.get_by_label("Holds for").select_option(label="all silos")
        panel.get_by_label("Begins at").fill("3")
        panel.get_by_label("Ends at").fill("1")
        panel.get_by_role("button", name="Save").click()
        panel.get_by_text("Saved.").wait_for()
    found = rules_of(company, key, "no-data")
    assert (list(found), found[None]["level"], found[None]["clear"]) == ([None], 10_800.0, 3600.0)


def test_a_product_is_added_from_the_usual_ones_and_chosen_for_a_silo(
    chromium: Any, company: Running, admin: Any, key: str
) -> None:
    with signed_in(chromium, company, admin, viewport=PHONE) as visit:
        page = visit.open("#/settings")
        products = page.get_by_role("region", name="Products")
        products.get_by_label("Begin from").select_option("barley")
        products.locator("summary", has_text="Add product").click()
        form = products.locator("details[open]")
        assert form.get_by_label("Density as poured").input_value() == "619"
        form.get_by_label("Name").fill("Ordi d'hivern")
        form.get_by_label("Density as poured").fill("641.5")
        form.get_by_role("button", name="Save").click()
        products.get_by_role("listitem").filter(has_text="Ordi d'hivern").wait_for()
        made = {one["id"]: one for one in company.get("products", key)["items"]}["ordi-d-hivern"]
        assert (made["density_kg_m3"], made["density_std_kg_m3"]) == (641.5, 31.0)
        row = products.get_by_role("listitem").filter(has_text="Ordi d'hivern")
        change(row, "Change", Density_as_poured="650")
        row.get_by_text("650 ± 31").wait_for()
        panel = visit.open(f"#/silos/{SILO}/settings").get_by_role("tabpanel")
        general = panel.get_by_role("region", name="Name and product")
        general.locator("summary").click()
        general.get_by_label("Product").select_option(label="Ordi d'hivern")
        general.get_by_role("button", name="Save").click()
        general.get_by_text("650 kg/m³").wait_for()
        assert company.get(f"silos/{SILO}", key)["product"] == "ordi-d-hivern"
        assert visit.errors == []


def test_a_silo_gets_a_name_a_notice_and_lengths(chromium: Any, company: Running, admin: Any, key: str) -> None:
    with signed_in(chromium, company, admin) as visit:
        page = visit.open("#/silos/north-2/settings")
        general = page.get_by_role("region", name="Name and product")
        change(general, "Change", Name="Big one", Notice="Closed until Friday")
        page.get_by_role("heading", name="Big one").wait_for()
        page.locator(".note", has_text="Closed until Friday").wait_for()
        lengths = page.get_by_role("region", name="Inner lengths")
        lengths.locator("summary").click()
        lengths.get_by_label("Diameter (m)", exact=True).fill("2.345")
        lengths.get_by_role("button", name="Save").click()
        lengths.get_by_text("2.345 m").wait_for()
        silo = company.get("silos/north-2", key)
        assert (silo["name"], silo["vessel"]["diameter"]) == ("Big one", 2.345)
        page.get_by_role("button", name="Measure all anew").click()
        page.get_by_text("measured anew.").wait_for()
        assert visit.errors == []


def test_who_saves_what_another_has_changed_meanwhile_is_told(
    chromium: Any, company: Running, admin: Any, key: str
) -> None:
    """The page's knowledge of the other change is held back, as by a slow link."""
    with signed_in(chromium, company, admin) as one, signed_in(chromium, company, admin) as other:
        for visit in (one, other):
            visit.open("#/silos/north-3/settings").get_by_role("region", name="Name and product").wait_for()
        one.page.context.route("**/api/v1/events**", lambda handler: handler.abort())
        one.page.context.route("**/api/v1/silos/north-3", lambda handler: held(handler))
        general = one.page.get_by_role("region", name="Name and product")
        change(other.page.get_by_role("region", name="Name and product"), "Change", Name="Theirs")
        general.locator("summary").click()
        general.get_by_label("Name").fill("Mine")
        general.get_by_role("button", name="Save").click()
        general.get_by_role("alert").wait_for()
        assert company.get("silos/north-3", key)["name"] == "Theirs"


def held(handler: Any) -> None:
    """Lets writing through and no reading."""
    if handler.request.method == "GET":
        handler.abort()
    else:
        handler.continue_()


def test_a_cameras_interval_and_a_places_name(chromium: Any, company: Running, admin: Any, key: str) -> None:
    with signed_in(chromium, company, admin, viewport=PHONE) as visit:
        page = visit.open("#/cameras")
        row = page.get_by_role("listitem").filter(has_text="cam-north-1")
        change(row, "Interval", A_frame_every="7.5")
        cameras = {one["id"]: one for one in company.get("cameras", key)["items"]}
        assert cameras["cam-north-1"]["expected_s"] == 450
        places = visit.open("#/settings").get_by_role("region", name="Places")
        row = places.get_by_role("listitem").first
        change(row, "Change", Name="Yard")
        assert "Yard" in [one["name"] for one in company.get("places", key)["items"]]
        assert visit.errors == []


def test_a_role_is_given_and_taken(chromium: Any, company: Running, admin: Any, key: str) -> None:
    administer("user", "Roland", "--data", str(company.data), "--role", "viewer")
    with signed_in(chromium, company, admin) as visit:
        people = visit.open("#/settings").get_by_role("region", name="People")
        row = people.get_by_role("listitem").filter(has_text="Roland")
        row.locator("summary").click()
        row.get_by_label("May").select_option(label="see and acknowledge")
        row.get_by_role("button", name="Save").click()
        row.locator(".badge", has_text="see and acknowledge").wait_for()
        row.locator("summary").click()
        row.get_by_label("May").select_option(label="nothing there")
        row.get_by_role("button", name="Save").click()
        row.locator(".badge").wait_for(state="detached")
        assert visit.errors == []


def test_a_mistyped_ticket_is_taken_back(chromium: Any, company: Running, admin: Any, key: str) -> None:
    with signed_in(chromium, company, admin, viewport=PHONE) as visit:
        panel = visit.open(f"#/silos/{SILO}/tickets").get_by_role("tabpanel")
        panel.get_by_label("Time").fill("2026-11-20T07:30")
        panel.get_by_label("Weight").fill("62.5")
        panel.get_by_label("Number").fill("W-1")
        panel.get_by_role("button", name="Add ticket").click()
        panel.get_by_role("button", name="Remove W-1").click()
        panel.get_by_text("No ticket has been entered.").wait_for()
        assert company.get(f"silos/{SILO}/tickets", key)["items"] == []
        (line,) = [one for one in company.get("audit", key)["items"] if one["action"] == "remove ticket"]
        assert (line["who"], line["detail"]["number"], line["detail"]["mass_kg"]) == ("Anna", "W-1", 62_500.0)


def test_forms_are_reached_and_left_by_the_keyboard(chromium: Any, company: Running, admin: Any) -> None:
    with signed_in(chromium, company, admin) as visit:
        page = visit.open("#/cameras")
        row = page.get_by_role("listitem").filter(has_text="cam-north-2")
        row.locator("summary").focus()
        page.keyboard.press("Enter")
        page.keyboard.press("Tab")
        page.keyboard.type("12")
        page.keyboard.press("Enter")
        row.get_by_text("Saved.").wait_for()
        until(page, "document.activeElement.tagName === 'SUMMARY'")


def test_who_may_not_change_anything_finds_no_form(visit: Visit) -> None:
    """This machine is an operator while there is no user."""
    for where in (f"#/silos/{SILO}/rules", f"#/silos/{SILO}/settings", "#/cameras"):
        page = visit.open(where)
        page.get_by_text("Ends at" if "rules" in where else "Events" if "silos" in where else "Aim").first.wait_for()
        assert page.locator("summary.button").count() == 0
        assert page.get_by_role("tab", name="Settings").count() == 0


VIEWS = (f"#/silos/{SILO}/rules", f"#/silos/{SILO}/settings", "#/settings", "#/cameras")


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_axe_finds_nothing_serious_on_open_forms(
    chromium: Any, company: Running, admin: Any, theme: str, size: dict[str, int]
) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is missing: make page")
    with signed_in(chromium, company, admin, color_scheme=theme, viewport=size) as visit:
        for view in VIEWS:
            page = visit.open(view)
            page.locator("summary.button").first.wait_for()
            page.evaluate("document.querySelectorAll('details.x, .edit details').forEach((one) => { one.open = true })")
            assert grave(page) == [], view
            assert page.evaluate("document.documentElement.scrollWidth") <= size["width"], view


@pytest.mark.parametrize(("language", "word"), [("es", "Cambiar"), ("ca", "Canvia"), ("de", "Ändern")])
def test_forms_speak_every_language(chromium: Any, company: Running, admin: Any, language: str, word: str) -> None:
    with signed_in(chromium, company, admin, locale=language, viewport=PHONE) as visit:
        page = visit.open(f"#/silos/{SILO}/settings")
        wait_for(lambda: page.locator("summary", has_text=word).count() == 2, 30, "the forms are not there")
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]

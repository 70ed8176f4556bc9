"""Changing a site: through the interface, and through SITE.toml."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from monitor.servers import Server, ago, eventually, frame_bytes, problem, serving, write_site
from siloscope.errors import InputError
from siloscope.monitor import site
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import places
from siloscope.monitor.store.engine import opened


def test_a_setting_is_changed_by_who_has_seen_it(shared: Server) -> None:
    admin = shared.token("admin")
    made = shared.send("PUT", "/api/v1/silos/new", {"name": "New", "place": "farm"}, admin)
    assert (made.status, made.headers["etag"]) == (200, '"1"')
    blind = shared.send("PUT", "/api/v1/silos/new", {"name": "Newer"}, admin)
    assert problem(blind) == (428, "precondition-required")
    changed = shared.send("PUT", "/api/v1/silos/new", {"banner": "closed"}, admin, If_Match='"1"')
    assert (changed.json["name"], changed.json["banner"], changed.headers["etag"]) == ("New", "closed", '"2"')
    late = shared.send("PUT", "/api/v1/silos/new", {"name": "Other"}, admin, If_Match='"1"')
    assert problem(late) == (412, "changed-meanwhile")
    wrong = shared.send("PUT", "/api/v1/silos/new", {"place": "nowhere"}, admin, If_Match='"2"')
    assert problem(wrong) == (422, "invalid")
    assert shared.ask("DELETE", "/api/v1/silos/new", token=admin, If_Match='"2"').status == 204
    assert problem(shared.get("/api/v1/silos/new", admin)) == (404, "not-found")


def test_rules_are_set_and_end_their_alerts(shared: Server) -> None:
    admin = shared.token("admin")
    token = shared.token("camera", "cam8")
    rule = {"kind": "overfill", "silo": "silo7", "level": 0.3}
    assert shared.send("PUT", "/api/v1/rules/mine", rule, admin).json["clear"] == pytest.approx(0.29, abs=0.01)
    wrong = shared.send("PUT", "/api/v1/rules/odd", {"kind": "low", "level": 0.5, "clear": 0.4}, admin)
    assert problem(wrong) == (422, "invalid")
    taken = shared.post("cam8", frame_bytes(0.6), token, Captured_At=ago(seconds=1))
    shared.settled(taken.json["frame"])
    alert = eventually(
        lambda: [a for a in shared.get("/api/v1/alerts?state=firing").json["items"] if a["rule"] == "mine"]
    )[0]
    assert (alert["silo"], alert["acknowledged"], alert["threshold"]) == ("silo7", None, 0.3)
    assert alert["value"] > 0.3
    seen = shared.send("POST", f"/api/v1/alerts/{alert['id']}:acknowledge", {"note": "known"})
    assert (seen.json["acknowledged_by"], seen.json["note"]) == ("this machine", "known")
    again = shared.send("POST", f"/api/v1/alerts/{alert['id']}:acknowledge", {"note": "late"})
    assert again.json["note"] == "known"
    assert shared.ask("DELETE", "/api/v1/rules/mine", token=admin, If_Match='"1"').status == 204
    after = shared.get("/api/v1/alerts?silo=silo7").json["items"]
    assert {a["id"]: a["state"] for a in after}[alert["id"]] == "resolved"


def test_tables_have_all_readings_with_their_deviations(shared: Server) -> None:
    token = shared.token("camera", "cam7")
    for minutes, level in ((90, 0.55), (80, 0.52)):
        shared.settled(shared.post("cam7", frame_bytes(level), token, Captured_At=ago(minutes=minutes)).json["frame"])
    rows = list(csv.DictReader(io.StringIO(shared.get("/api/v1/silos/silo7/readings?format=csv").body.decode())))
    first = shared.get("/api/v1/silos/silo7/readings?count=1").json
    assert len(rows) >= 2
    assert float(rows[0]["volume_m3"]) == first["items"][0]["volume_m3"]
    assert all(float(row["volume_std_m3"]) > 0 for row in rows if row["status"] == "ok")
    second = shared.get(f"/api/v1/silos/silo7/readings?count=1000&after={first['next']}").json
    assert len(first["items"]) + len(second["items"]) == len(rows)
    assert second["next"] is None
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(pyarrow.BufferReader(shared.get("/api/v1/silos/silo7/readings?format=parquet").body))
    assert table.num_rows == len(rows)
    trend = shared.get("/api/v1/silos/silo7/readings?buckets=10").json
    assert sum(bucket["count"] for bucket in trend["items"]) == sum(row["status"] == "ok" for row in rows)


def test_a_ticket_is_taken_back_once_and_only_from_its_silo(shared: Server) -> None:
    made = shared.send(
        "POST", "/api/v1/silos/silo7/tickets", {"time": "2026-11-01T06:00:00Z", "mass_kg": 6250, "number": "W-1"}
    )
    path = f"tickets/{made.json['id']}"
    admin = shared.token("admin")
    shared.send("PUT", "/api/v1/silos/elsewhere", {"name": "Elsewhere"}, admin)
    assert problem(shared.ask("DELETE", f"/api/v1/silos/elsewhere/{path}")) == (404, "not-found")
    assert shared.ask("DELETE", f"/api/v1/silos/silo7/{path}", token=shared.token("read")).status == 403
    assert shared.ask("DELETE", f"/api/v1/silos/silo7/{path}").status == 204
    assert shared.get("/api/v1/silos/silo7/tickets").json["items"] == []
    assert problem(shared.ask("DELETE", f"/api/v1/silos/silo7/{path}")) == (404, "not-found")
    line = shared.get("/api/v1/audit?count=1", admin).json["items"][0]
    assert (line["action"], line["detail"]["number"], line["detail"]["mass_kg"]) == ("remove ticket", "W-1", 6250.0)


def test_the_usual_products_have_their_densities(shared: Server) -> None:
    found = {one["name"]: one for one in shared.get("/api/v1/usual-products").json["items"]}
    assert (found["wheat"]["density_kg_m3"], found["wheat"]["density_std_kg_m3"]) == (775.0, 28.0)
    assert list(found) == sorted(found)


def applied(folder: Path, text: str) -> list[str]:
    path = folder / "SITE.toml"
    path.write_text(text)
    store = opened(Settings(folder).url)
    with store.write() as connection:
        site.apply(connection, site.read(path), path, 1)
    with store.read() as connection:
        found = [row.id for row in places.listed(connection, "silo")]
    store.close()
    return found


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[[silo]]\nid = "a/b"', "silo\\[0\\].id.*letters"),
        ('[[silo]]\nid = "a"\nplace = "b"', "names the place 'b', which is not there"),
        ('[[silo]]\nid = "a"\nproduct = "gold"', "names the product 'gold'"),
        ('[[silo]]\nid = "a"\ncolour = "red"', "unknown entry 'silo\\[0\\].colour'"),
        ('[[camera]]\nid = "c"\nsilo = "a"', "names the silo 'a', which is not there"),
        ('[[silo]]\nid = "a"\ncalibration = "none.json"', "none.json"),
        ('[[rule]]\nid = "r"\nkind = "loud"', "kind"),
        ('[site]\nzone = "Europe/Madird"', "site.zone.*must be a time zone"),
        ("[[silo", "no TOML site"),
    ],
)
def test_a_mistake_in_the_site_is_told_with_its_place_and_changes_nothing(tmp_path: Path, text: str, told: str) -> None:
    assert applied(tmp_path, '[[silo]]\nid = "kept"') == ["kept"]
    with pytest.raises(InputError, match=told):
        applied(tmp_path, text)
    assert applied(tmp_path, "") == ["kept"]


def test_the_site_is_applied_at_every_start_and_leaves_what_it_does_not_name(tmp_path: Path) -> None:
    path = write_site(tmp_path / "site")
    with serving(tmp_path / "data", path) as server:
        admin = server.token("admin")
        assert server.send("PUT", "/api/v1/silos/silo7", {"banner": "mine"}, admin, If_Match='"1"').status == 200
        assert server.send("PUT", "/api/v1/silos/other", {"name": "Other"}, admin).status == 200
        assert server.stop() == 0
    path.write_text(path.read_text().replace('id = "silo7"\nplace', 'id = "silo7"\nname = "Seven"\nplace'))
    with serving(tmp_path / "data", path) as server:
        silos = {silo["id"]: silo for silo in server.get("/api/v1/silos").json["items"]}
        assert (silos["silo7"]["name"], silos["silo7"]["banner"]) == ("Seven", "mine")
        assert silos["other"]["name"] == "Other"
        assert len(server.get("/api/v1/silos/silo7/calibrations").json["items"]) == 1

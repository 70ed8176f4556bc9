"""Units, tickets, strapping tables, conservation of volume: what the trade counts with."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from silos import STOUT, known, measured, scene
from siloscope.cli import main
from siloscope.conservation import Amount, change, check_volume, moved_amount
from siloscope.content import units
from siloscope.content.capacity import Strapping
from siloscope.content.knowledge import know
from siloscope.content.strapping_table import strapping_table, write_csv
from siloscope.errors import InputError, UsageError
from siloscope.reconcile import Ticket, read_tickets, reconcile
from siloscope.schema import documents
from siloscope.simulation import Feed
from siloscope.types.track import Event, utc
from siloscope.vessel.vessel import given

Shown = pytest.CaptureFixture[str]


class TestUnits:
    def test_they_have_their_legal_sizes(self) -> None:
        """NIST Handbook 44, Appendix C; 60 lb/bu are 772 kg/m³."""
        assert pytest.approx(0.03523907, rel=1e-7) == units.BUSHEL
        assert units.MASSES["short-ton"][0] == pytest.approx(907.18474, rel=1e-9)
        assert units.test_weight("60") == pytest.approx(772.3, abs=0.1)
        assert units.test_weight("77.2 kg/hl") == pytest.approx(772.0)
        bushels = 10.0**2 * 20.0 * 0.7854 * 0.80356  # feet; the rule of thumb for a round bin
        assert math.pi * 1.524**2 * 6.096 / units.BUSHEL == pytest.approx(bushels, rel=1e-3)

    def test_shrink_keeps_the_dry_matter(self) -> None:
        assert units.at_moisture(1000.0, 0.20, 0.15) == pytest.approx(941.18, abs=0.01)
        assert units.at_moisture(1000.0, 0.15, 0.0) == pytest.approx(850.0)

    def test_what_is_none(self) -> None:
        for text in ("heavy", "-3", "6000", "nan"):
            with pytest.raises(UsageError):
                units.test_weight(text)
        with pytest.raises(UsageError):
            units.unit("firkin")
        with pytest.raises(UsageError):
            units.at_moisture(1.0, 0.8, 0.15)


def _events(count: int, density: float, seed: int = 0) -> tuple[list[Event], list[Ticket]]:
    """Deliveries with 0.2 % of volume error and tickets with 0.5 % of scale noise, one hour after the event."""
    draw = np.random.default_rng(seed)
    events, tickets = [], []
    for k in range(count):
        volume = float(draw.uniform(5.0, 30.0))
        start = 1.7e9 + 86_400.0 * k
        events.append(Event("refill", 2 * k, 2 * k + 1, start, start + 1800.0, volume, 0.002 * volume))
        mass = density * volume * (1.0 + 0.002 * draw.standard_normal()) * (1.0 + 0.005 * draw.standard_normal())
        tickets.append(Ticket(start + 5400.0, mass, f"T{k}"))
    return events, tickets


class TestTickets:
    def test_ten_deliveries_give_the_density_within_a_percent(self) -> None:
        off = []
        for seed in range(40):
            found = reconcile(*_events(10, 772.0, seed))
            assert found.density is not None
            assert found.density_std is not None
            off.append((found.density - 772.0) / found.density_std)
            assert abs(found.density - 772.0) < 7.7
        assert 0.7 < np.std(off) < 1.4

    def test_what_does_not_match_is_named(self) -> None:
        events, tickets = _events(10, 650.0)
        tickets[3] = Ticket(tickets[3].time, 0.6 * tickets[3].mass, "short")
        tickets.append(Ticket(1.0e9, 900.0, "lost"))
        tickets.append(Ticket(tickets[5].time, -500.0, "out"))
        found = reconcile(events[:-1], tickets)
        assert [match.tickets[0].name for match in found.outlying] == ["short"]
        assert {ticket.name for ticket in found.unmatched} == {"lost", "out", "T9"}
        assert found.density == pytest.approx(650.0, rel=0.01)

    def test_packing_shows_where_deliveries_reach_deep_and_shallow(self) -> None:
        """A content V that weighs 640 (V + 0.05 V² / 60), filled and emptied between 5 and 60 m³."""
        off = []
        for seed in range(20):
            draw = np.random.default_rng(seed)
            low, high = draw.uniform(4.0, 25.0, 16), draw.uniform(30.0, 60.0, 16)
            levels = np.column_stack([low, high]).ravel()
            weights = 640.0 * (levels + 0.05 * levels**2 / 60.0)
            events, tickets = [], []
            for k in range(len(levels) - 1):
                start, moved = 1.7e9 + 86_400.0 * k, levels[k + 1] - levels[k]
                kind = "refill" if moved > 0.0 else "withdrawal"
                events.append(Event(kind, k, k + 1, start, start + 1800.0, abs(moved), 0.001 * abs(moved)))
                mass = (weights[k + 1] - weights[k]) * (1.0 + 0.003 * draw.standard_normal())
                tickets.append(Ticket(start + 600.0, mass, f"T{k}"))
            found = reconcile(events, tickets, 0.003, dict(enumerate(levels.tolist()))).packing
            assert found is not None
            assert found.loose == pytest.approx(640.0, rel=0.02)
            truth = 0.05 * found.volume / 60.0
            assert found.growth == pytest.approx(truth, abs=0.02)
            off.append((found.growth - truth) / found.growth_std)
        assert 0.6 < float(np.std(off)) < 1.5

    def test_packing_is_not_told_from_like_deliveries(self) -> None:
        events, tickets = _events(10, 700.0)
        volumes = {index: 1000.0 + index % 2 * event.volume for event in events for index in (event.first, event.last)}
        assert reconcile(events, tickets, volumes=volumes).packing is None

    def test_one_event_is_no_density(self) -> None:
        assert reconcile(*_events(1, 650.0)).density is None

    def test_several_trucks_of_one_delivery_add_up(self) -> None:
        events, tickets = _events(4, 700.0)
        halves = [Ticket(t.time + side, 0.5 * t.mass, t.name) for t in tickets for side in (-600.0, 0.0)]
        assert reconcile(events, halves).density == pytest.approx(reconcile(events, tickets).density)

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("when,weight\n", "heading"),
            ("time,mass\nyesterday,5\n", "line 2"),
            ("time,mass\n2026-03-01T06:00Z,heavy\n", "line 2"),
            ("time,mass\n2026-03-01T06:00Z,0\n", "delivery"),
        ],
    )
    def test_a_damaged_table_names_the_line(self, tmp_path: Path, text: str, says: str) -> None:
        file = tmp_path / "tickets.csv"
        file.write_text(text)
        with pytest.raises(InputError, match=says):
            read_tickets(file)

    def test_the_command(self, tmp_path: Path, capsys: Shown) -> None:
        events, tickets = _events(6, 700.0)
        track = {"schema": "siloscope.track/1", "events": [event.to_dict() for event in events]}
        (tmp_path / "track.json").write_text(json.dumps(track))
        rows = [f"{utc(t.time)};{t.mass / 1000:.4f};{t.name}".replace(".", ",") for t in tickets]
        (tmp_path / "tickets.csv").write_text("time;mass;ticket\n" + "\n".join(rows) + "\n")
        command = ["reconcile", str(tmp_path / "track.json"), "--tickets", str(tmp_path / "tickets.csv"), "--unit", "t"]
        assert main([*command, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["density_kg_m3"] == pytest.approx(700.0, rel=0.01)


class TestStrapping:
    def test_the_table_is_the_silo_s(self, tmp_path: Path) -> None:
        made = known(scene(None), 1e-3)
        table = strapping_table(know(made, None, given(None, 0.0).sheet, 0.0, None), given(None, 0.0))
        assert table.rows[0].volume == pytest.approx(0.0, abs=1e-9)
        assert table.rows[-1].volume == pytest.approx(STOUT.capacity, rel=1e-9)
        cone = next(row for row in table.rows if abs(row.height - 0.6) < 1e-6)
        assert cone.volume == pytest.approx(math.pi * 0.625**2 * 0.6 / 3.0)
        assert math.hypot(*(share for _, _, share in table.budget)) == pytest.approx(table.rows[-1].std)
        radius = {name: share for name, _, share in table.budget}["radius"]
        assert radius == pytest.approx(
            2.0 * math.pi * 1.25 * 2.5 * 1e-3 + 2.0 * math.pi * 1.25 * 1.2 / 3.0 * 1e-3, rel=0.01
        )
        read = Strapping.read(write_csv(tmp_path / "table.csv", table))
        assert read.volume(1.7) == pytest.approx(math.pi * 1.25**2 * (0.5 + 0.4), rel=1e-6)

    def test_without_a_bottom_there_is_none(self, tmp_path: Path, capsys: Shown) -> None:
        made = known(scene(None))
        made.save(tmp_path / "silo.json")
        assert main(["strap", str(tmp_path / "silo.json"), "--bottom", "unknown"]) == 3
        assert "bottom" in capsys.readouterr().err

    def test_the_command_writes_table_and_page(self, tmp_path: Path, capsys: Shown) -> None:
        known(scene(None), 1e-3).save(tmp_path / "silo.json")
        files = ["-o", str(tmp_path / "silo.csv"), "--page", str(tmp_path / "silo.html")]
        assert main(["strap", str(tmp_path / "silo.json"), "--top", "-0.1", *files]) == 0
        assert "k = 2" in capsys.readouterr().out
        assert "Uncertainty budget" in (tmp_path / "silo.html").read_text("utf-8")
        assert Strapping.read(tmp_path / "silo.csv").capacity == pytest.approx(STOUT.capacity + math.pi * 1.25**2 * 0.1)


class TestConservation:
    def readings(self) -> list[Any]:
        return [measured(scene(Feed("mound", level)))[0] for level in (0.5, 0.58)]

    def test_what_was_moved_is_what_differs(self) -> None:
        low, high = self.readings()
        true = measured(scene(Feed("mound", 0.58)))[1].true_volume - measured(scene(Feed("mound", 0.5)))[1].true_volume
        found = check_volume(change(low, high), Amount(true, 0.005 * true))
        assert found.agrees
        assert not check_volume(change(low, high), Amount(1.1 * true, 0.005 * true)).agrees
        assert check_volume(change(high, low), Amount(true, 0.005 * true)).agrees

    def test_amounts_have_units(self) -> None:
        assert moved_amount("3.5 m3").volume == pytest.approx(3.5)
        assert moved_amount("2.4t", 800.0, 8.0).volume == pytest.approx(3.0)
        assert moved_amount("2.4t", 800.0, 8.0).std == pytest.approx(0.03)
        assert moved_amount("100bu").volume == pytest.approx(3.5239, rel=1e-4)
        for text, density in (("2.4t", None), ("much", 800.0), ("3", 800.0), ("-m3", None)):
            with pytest.raises(UsageError):
                moved_amount(text, density)

    def test_the_command(self, tmp_path: Path, capsys: Shown) -> None:
        for name, content in zip(("a", "b"), self.readings(), strict=True):
            (tmp_path / f"{name}.json").write_text(json.dumps(documents.plain(content.to_dict())))
        files = [str(tmp_path / f"{name}.json") for name in ("a", "b")]
        amount = change(*self.readings()).volume
        assert main(["check-volume", *files, "--moved", f"{amount}m3", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["agrees"]
        assert main(["check-volume", *files, "--into", *reversed(files)]) == 0
        assert "they agree" in capsys.readouterr().out
        assert main(["check-volume", *files]) == 2
        assert main(["check-volume", files[0], str(tmp_path / "none.json"), "--moved", "1m3"]) == 3

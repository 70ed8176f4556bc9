"""Bottoms of every kind told by a vessel file, held against the oracle's quadrature."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import siloscope
import vessels
from oracle import bottoms as true
from oracle.feed import Feed, Tip
from siloscope.content.over_floor import places
from siloscope.errors import InputError, UsageError
from siloscope.vessel import bottoms
from siloscope.vessel.vessel import load

KINDS = ("flat_ring", "crater", "two_stage", "pyramid", "oblique")


def vessel_file(seen: vessels.Seen, path: Path) -> Path:
    """What a maker would write of the oracle's vessel."""
    wall, bottom, top = seen.vessel.wall, seen.vessel.bottom, seen.top
    lines = [f"diameter = {2 * wall.radius}", f"cylinder = {bottom.rim - top}", f"top = {top}", "[bottom]"]
    match bottom:
        case true.Flat():
            lines += ['kind = "flat"']
        case true.TwoStage():
            lines += ['kind = "two-stage"', f"height = {bottom.upper + bottom.lower}", f"upper = {bottom.upper}",
                      f"waist = {2 * bottom.waist}", f"outlet = {2 * bottom.outlet}"]  # fmt: skip
        case true.Pyramid():
            lines += [f'kind = "{bottom.kind}"', f"height = {bottom.height}", f"outlet = {2 * bottom.outlet}",
                      f"azimuth = {math.degrees(bottom.azimuth)}"]  # fmt: skip
        case true.Cone():
            lines += ['kind = "oblique"', f"height = {bottom.height}", f"outlet = {2 * bottom.outlet}",
                      f"vertex = [{bottom.offset[0]}, {bottom.offset[1]}]"]  # fmt: skip
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_told_bottom_gives_a_true_volume(kind: str, seed: int, tmp_path: Path) -> None:
    seen = vessels.Seen.draw(kind, seed)
    content = siloscope.measure(seen.frame, seen.calibration(), vessel=vessel_file(seen, tmp_path / "vessel.toml"))
    assert content.ok, content.message
    assert content.volume is not None
    assert content.volume_std is not None
    off = abs(content.volume - seen.content)
    assert off < 0.02 * seen.capacity, (content.volume, seen.content, content.coverage)
    assert off < 4.0 * content.volume_std
    assert content.capacity == pytest.approx(seen.capacity, rel=3e-3)


@pytest.mark.parametrize("kind", ["two_stage", "pyramid", "oblique", "flat_empty"])
def test_an_empty_vessel_reads_nothing(kind: str, tmp_path: Path) -> None:
    seen = vessels.Seen.draw(kind, 1).with_feed(None)
    content = siloscope.measure(seen.frame, seen.calibration(), vessel=vessel_file(seen, tmp_path / "vessel.toml"))
    assert content.ok, content.message
    assert content.volume is not None
    assert content.volume_std is not None
    assert content.volume < min(3.0 * content.volume_std, 0.02 * seen.capacity)


@pytest.mark.parametrize(("kind", "seeds"), [("pyramid", (960, 961, 963)), ("two_stage", (962,))])
def test_what_lies_out_of_view_is_in_the_deviation(kind: str, seeds: tuple[int, ...], tmp_path: Path) -> None:
    """Cameras that look past the outlet, and feed that lies where they don't look: 0.5 to 1.5 % of the capacity."""
    errors = []
    for seed in seeds:
        empty = vessels.Seen.draw(kind, seed).with_feed(None)
        low, radius = empty.vessel.bottom.lowest, empty.vessel.wall.radius
        z = low - 0.15 * (low - 0.9)
        for feed in (Feed(z), Feed(z, tip=Tip(0.1 * radius, 0.1 * radius, z - 0.2 * radius, math.tan(0.45)))):
            seen = empty.with_feed(feed)
            content = siloscope.measure(seen.frame, seen.calibration(), vessel=vessel_file(seen, tmp_path / "v.toml"))
            if content.volume is not None and content.volume_std is not None:
                errors.append((content.volume - seen.content) / content.volume_std)
    assert len(errors) >= 2 * len(seeds) - 1
    assert max(map(abs, errors)) < 3.5, errors


@pytest.mark.parametrize("outlet", [0.0, 0.3])
@pytest.mark.parametrize("azimuth", [0.0, 0.3])
def test_wedge_and_pyramid_hold_what_integration_says(outlet: float, azimuth: float) -> None:
    """Under a circle of radius R: h R² (π - 4/3) in a wedge, h R² (π - 4 √2 / 3) in a pyramid, less the cut tip."""
    radius, height = 1.3, 1.1
    half = outlet / 2.0
    strip = 2.0 * (half * math.sqrt(radius**2 - half**2) + radius**2 * math.asin(half / radius))
    chords = 4.0 / 3.0 * (radius**3 - (radius**2 - half**2) ** 1.5)  # ∫ |x| dA over the strip |x| < half
    tip = {
        "wedge": height / radius * (half * strip - chords),
        "pyramid": height / radius * 4.0 * half**3 / 3.0,
    }
    whole = {"wedge": math.pi - 4.0 / 3.0, "pyramid": math.pi - 4.0 * math.sqrt(2.0) / 3.0}
    for bottom in (bottoms.Wedge(height, outlet, azimuth), bottoms.Pyramid(height, outlet, azimuth)):
        floor = bottom.floor_map(radius, 0.0)
        x, y, area = places(radius, (0.0, 0.0))
        held = float(floor.at(floor.z, x, y).sum() * area)
        assert held == pytest.approx(height * radius**2 * whole[bottom.kind] - tip[bottom.kind], rel=1e-3)


@pytest.mark.parametrize("level", [0.2, 0.7])
def test_a_told_wedge_gives_a_true_volume(level: float, tmp_path: Path) -> None:
    """Its content by quadrature over the oracle's wedge."""
    drawn = vessels.Seen.draw("pyramid", 1)
    rim, radius = drawn.vessel.bottom.rim, drawn.vessel.wall.radius
    wedge = true.Wedge(rim, radius, 1.2 * radius, 0.5, 0.1 * radius)
    empty = vessels.Seen(replace(drawn.scene, vessel=replace(drawn.vessel, bottom=wedge)))
    seen = empty.with_feed(Feed(wedge.lowest - level * (wedge.lowest - 0.6 * rim)))
    content = siloscope.measure(seen.frame, seen.calibration(), vessel=vessel_file(seen, tmp_path / "vessel.toml"))
    assert content.volume is not None
    off = abs(content.volume - seen.content)
    assert off < 0.02 * seen.capacity
    assert off < 4.0 * (content.volume_std or 0.0)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (true.Cone(0.0, 1.3, 1.5, 0.1, (0.4, -0.3)), bottoms.Oblique(1.5, 0.2, 0.4, -0.3)),
        (true.TwoStage(0.0, 1.3, 0.5, 0.6, 0.9, 0.08), bottoms.TwoStage(1.4, 0.16, 0.5, 1.2)),
        (true.Pyramid(0.0, 1.3, 1.1, 0.4, 0.1), bottoms.Pyramid(1.1, 0.2, 0.4)),
        (true.Wedge(0.0, 1.3, 1.1, 0.4, 0.1), bottoms.Wedge(1.1, 0.2, 0.4)),
    ],
)
def test_a_kind_is_the_oracle_s_surface(made: true.Bottom, told: bottoms.Bottom) -> None:
    """Just above the floor there is air, just below it none."""
    across = 1.29 * np.sqrt(np.random.default_rng(0).random(500))
    angle = np.random.default_rng(1).uniform(0.0, 2.0 * math.pi, 500)
    x, y = across * np.cos(angle), across * np.sin(angle)
    z = told.depth(x, y, 1.3)
    assert (made.air(x, y, z - 1e-6) > 0.0).all()
    assert (made.air(x, y, z + 1e-6) < 0.0).all()


def test_without_the_top_a_flat_floor_has_no_place() -> None:
    seen = vessels.Seen.draw("crater", 0)
    content = siloscope.measure(seen.frame, seen.calibration(), bottom="flat", cylinder=3.0)
    assert content.volume is None
    assert content.missing == ("top",)
    assert "--top" in (content.message or "")


def test_courses_and_roof_count(tmp_path: Path) -> None:
    seen = vessels.Seen.draw("crater", 0)
    file = vessel_file(seen, tmp_path / "plain.toml")
    plain = siloscope.measure(seen.frame, seen.calibration(), vessel=file)
    radius, cylinder = seen.vessel.wall.radius, seen.vessel.bottom.rim - seen.top
    head, _, bottom = file.read_text().partition("[bottom]")
    more = f"fill_height = {cylinder + 0.2}\n"
    parts = f"[roof]\nheight = 0.4\nopening = 0.2\n[[course]]\nbottom = 0.0\ndiameter = {2 * radius + 0.02}\n"
    wide = tmp_path / "wide.toml"
    wide.write_text(f"{head}{more}[bottom]{bottom}{parts}")
    found = siloscope.measure(seen.frame, seen.calibration(), vessel=wide)
    at_end = radius + (0.1 - radius) * 0.5
    roof = math.pi * 0.2 * (radius**2 + radius * at_end + at_end**2) / 3.0
    ring = math.pi * ((radius + 0.01) ** 2 - radius**2) * cylinder
    assert found.capacity == pytest.approx((plain.capacity or 0.0) + roof + ring, rel=1e-6)
    assert (found.volume or 0.0) + (found.ullage or 0.0) == pytest.approx(found.capacity, rel=1e-3)
    assert 0.0 < (found.volume or 0.0) - (plain.volume or 0.0) < ring


def test_an_obstacle_is_cut_out(tmp_path: Path) -> None:
    """A bar across the bin just above the feed, which would be taken for feed that hangs."""
    seen = vessels.Seen.draw("crater", 1)
    level = seen.scene.feed.z if seen.scene.feed else 0.0
    rim = seen.vessel.bottom.rim
    bar = vessels.bar((-0.3, 0.2, level - 0.4), (0.8, -0.5, level - 0.4), 0.1)
    barred = seen.with_things((bar,))
    file = vessel_file(seen, tmp_path / "vessel.toml")
    clear = siloscope.measure(seen.frame, seen.calibration(), vessel=file)
    height = rim - level + 0.4
    obstacle = f"[[obstacle]]\nstart = [-0.3, 0.2, {height}]\nend = [0.8, -0.5, {height}]\ndiameter = 0.1\n"
    told = tmp_path / "told.toml"
    told.write_text(file.read_text() + obstacle)
    cut = siloscope.measure(barred.frame, seen.calibration(), vessel=told)
    assert siloscope.measure(barred.frame, seen.calibration(), vessel=file).has("obstruction")
    assert cut.has("obstruction") == clear.has("obstruction")
    assert cut.volume == pytest.approx(clear.volume or 0.0, abs=2e-3 * seen.capacity)


def test_a_crater_whose_ring_is_out_of_view_is_no_sure_volume(tmp_path: Path) -> None:
    """The flank alone is seen; continued to the wall, it is 13 % of the capacity too much."""
    empty = vessels.Seen.draw("flat_empty", 931)
    radius, low = empty.vessel.wall.radius, empty.vessel.bottom.lowest
    level, slope = low - 0.85 * (low - 0.9), math.tan(math.radians(35.0))
    seen = empty.with_feed(Feed(level, tip=Tip(0.0, 0.0, level + 0.5 * slope * radius, -slope)))
    content = siloscope.measure(seen.frame, seen.calibration(), vessel=vessel_file(seen, tmp_path / "vessel.toml"))
    assert content.reason == "too-little-seen"
    assert "deviation" in str(content.message)


@pytest.mark.parametrize("seed", [1, 2])
def test_an_obstacle_takes_its_own_volume(seed: int, tmp_path: Path) -> None:
    """A thick upright pipe: what stands in the feed is no feed, what stands over it is no free space."""
    seen = vessels.Seen.draw("crater", seed)
    wall, rim = seen.vessel.wall.radius, seen.vessel.bottom.rim
    place, thick, long = (0.5 * wall, 0.3 * wall), 0.15 * wall, rim - 0.4
    assert seen.scene.feed is not None
    deep = rim - float(seen.scene.feed.depth(*(np.array([at]) for at in place))[0])
    file = vessel_file(seen, tmp_path / "plain.toml")
    told = tmp_path / "pipe.toml"
    x, y = place
    pipe = f"[[obstacle]]\nstart = [{x}, {y}, -0.5]\nend = [{x}, {y}, {long}]\ndiameter = {thick}\n"
    told.write_text(file.read_text() + pipe)
    clear = siloscope.measure(seen.frame, seen.calibration(), vessel=file)
    cut = siloscope.measure(seen.frame, seen.calibration(), vessel=told)
    lost = {
        name: (getattr(clear, name) or 0.0) - (getattr(cut, name) or 0.0) for name in ("volume", "ullage", "capacity")
    }
    base = math.pi / 4.0 * thick**2
    assert lost["capacity"] == pytest.approx(base * long, rel=0.01)
    assert lost["volume"] == pytest.approx(base * deep, rel=0.05)
    assert lost["ullage"] == pytest.approx(base * (long - deep), rel=0.05)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("diameter = 0", "diameter"),
        ("diameter = 'wide'", "finite number"),
        ("weight = 3", "unknown entry"),
        ('[bottom]\nkind = "round"', "known are"),
        ('[bottom]\nkind = "oblique"', "height"),
        ('[bottom]\nkind = "flat"\nheight = 1.0', "flat"),
        ('[bottom]\nkind = "two-stage"\nheight = 1.0\nupper = 1.5\nwaist = 0.5', "upper"),
        ("outline = [[0, 0], [1, 0]]", "corners"),
        ("diameter = ", "no TOML"),
    ],
)
def test_a_damaged_vessel_file_names_the_entry(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=says):
        load(file)


def test_lengths_that_do_not_fit_each_other(tmp_path: Path) -> None:
    file = tmp_path / "vessel.toml"
    file.write_text('diameter = 2.0\n[bottom]\nkind = "oblique"\nheight = 1.0\nvertex = [3.0, 0.0]\n')
    with pytest.raises(UsageError, match="diameter"):
        load(file)

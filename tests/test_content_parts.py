"""Density, capacity, bare clouds: what the content is made of beside the frame."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import realdata
import siloscope
from silos import STOUT, known, measured, scene
from siloscope.content import Datasheet, Density, Strapping, products
from siloscope.content.density import choose, load
from siloscope.errors import InputError, UsageError
from siloscope.parameters import GRAVITY
from siloscope.simulation import Feed, Silo


class TestDensity:
    def test_every_product_names_its_source(self) -> None:
        for name, product in products().items():
            assert product.source, name
            assert 100.0 < product.loose < 1500.0
            assert 0.02 * product.loose <= product.std + 1e-9 <= 0.1 * product.loose, name

    def test_mass_is_volume_times_density_with_both_deviations(self) -> None:
        content, frame = measured(scene(Feed("flat", 0.5)), density=650.0, density_std=20.0)
        assert content.volume is not None
        assert content.volume_std is not None
        assert content.mass == pytest.approx(650.0 * content.volume)
        assert content.mass_std == pytest.approx(math.hypot(650.0 * content.volume_std, 20.0 * content.volume))
        assert content.mass == pytest.approx(650.0 * frame.true_volume, rel=1e-3)
        wheat, _ = measured(scene(Feed("flat", 0.5)), product="wheat")
        assert (wheat.density or {})["name"] == "wheat"
        assert wheat.mass == pytest.approx(products()["wheat"].loose * (wheat.volume or 0.0))

    def test_compaction_follows_janssen(self) -> None:
        """A density that grows linearly by a trifle: the mean pressure has a closed form."""
        rho, slope, mu, k, radius, height = 700.0, 1e-4, 0.4, 0.5, 1.2, 6.0
        product = Density("test", rho, compaction=((0.0, rho), (1e6, rho + slope * 1e6)), friction=mu, pressure_ratio=k)
        depth = radius / (2.0 * mu * k)
        full = rho * GRAVITY * depth
        pressure = full * (1.0 - depth / height * (1.0 - math.exp(-height / depth)))
        assert product.mean(np.array([height]), radius) - rho == pytest.approx(slope * pressure, rel=5e-3)

    def test_without_friction_the_pressure_is_hydrostatic(self) -> None:
        product = Density("test", 500.0, compaction=((0.0, 500.0), (1e6, 600.0)), friction=0.0)
        expected = 500.0 + 1e-4 * 500.0 * GRAVITY * 4.0 / 2.0
        assert product.mean(np.array([4.0]), 1.0) == pytest.approx(expected, rel=1e-3)

    def test_a_product_file(self, tmp_path: Path) -> None:
        file = tmp_path / "mash.toml"
        file.write_text("density = 550\ndensity_std = 11\ncompaction = [[0, 550], [20000, 600]]\nfriction = 0.3\n")
        product = load(str(file))
        assert (product.name, product.loose, product.std, product.friction) == ("mash", 550.0, 11.0, 0.3)
        content, _ = measured(scene(Feed("flat", 0.6)), product=file)
        assert (content.density or {})["mean_kg_m3"] > 555.0

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("density = 'much'", "finite number"),
            ("density_std = 3", "needs a density"),
            ("density = 600\nweight = 3", "unknown entry 'weight'"),
            ("density = 1e9", "between 10 and 10000"),
            ("density = 600\ncompaction = [[5, 600]]", "begin at pressure 0"),
            ("density = 600\ncompaction = [[0, 600], [0, 610]]", "rise"),
            ("density = 600\ncompaction = 7", "list of"),
            ("density = ", "no TOML"),
        ],
    )
    def test_a_damaged_product_file_names_the_entry(self, tmp_path: Path, text: str, says: str) -> None:
        file = tmp_path / "bad.toml"
        file.write_text(text)
        with pytest.raises(InputError, match=says):
            load(str(file))

    def test_what_contradicts_itself_is_refused(self) -> None:
        for bad in ({"density": 600.0, "product": "wheat"}, {"density_std": 3.0}, {"density": math.nan}):
            with pytest.raises(UsageError):
                choose(**bad)


class TestCapacity:
    def test_a_datasheet_tells_the_upper_edge(self) -> None:
        made = scene(Feed("flat", 0.5))
        content = siloscope.measure(made.render().frame(), known(made), cylinder=2.0)
        assert content.capacity == pytest.approx(math.pi * 1.25**2 * (2.0 + 1.2 / 3.0))
        assert content.capacity_from == "datasheet"
        higher = siloscope.measure(made.render().frame(), known(made), top=-0.3)
        assert higher.capacity == pytest.approx(math.pi * 1.25**2 * (2.8 + 1.2 / 3.0))

    def test_an_outlet_pipe_counts(self) -> None:
        made = scene(Feed("flat", 0.5), silo=replace(STOUT, outlet_radius=0.2, outlet_length=0.3))
        frame = made.render()
        plain = siloscope.measure(frame.frame(), known(made))
        piped = siloscope.measure(frame.frame(), known(made), outlet_diameter=0.4, outlet_length=0.3)
        tip = math.pi * 0.2**2 * (0.2 * 1.2 / 1.25) / 3.0
        pipe = math.pi * 0.2**2 * (0.3 + 0.2 * 1.2 / 1.25) - tip
        assert (piped.volume or 0.0) - (plain.volume or 0.0) == pytest.approx(pipe, rel=0.03)

    def test_a_strapping_table_of_the_same_silo_changes_nothing(self, tmp_path: Path) -> None:
        made = scene(Feed("mound", 0.5))
        heights = np.linspace(0.0, 3.7, 75)
        volumes = [math.pi * 1.25**2 * (max(h - 1.2, 0.0) + min(h / 1.2, 1.0) ** 3 * 1.2 / 3.0) for h in heights]
        file = tmp_path / "table.csv"
        rows = "\n".join(f"{h:.4f};{v:.6f}".replace(".", ",") for h, v in zip(heights, volumes, strict=True))
        file.write_text(f"Höhe;Volumen\n{rows}\n", encoding="utf-8")
        frame = made.render().frame()
        plain = siloscope.measure(frame, known(made))
        strapped = siloscope.measure(frame, known(made), strapping=file)
        assert strapped.capacity_from == "strapping"
        assert strapped.capacity == pytest.approx(made.silo.capacity, rel=1e-5)
        assert strapped.volume == pytest.approx(plain.volume or 0.0, rel=1e-3)
        doubled = Strapping(tuple(heights), tuple(2.0 * v for v in volumes))
        more = siloscope.measure(frame, known(made), strapping=doubled)
        assert (more.volume or 0.0) > 1.9 * (plain.volume or 0.0)

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("", "no rows"),
            ("height,volume\n", "no rows"),
            ("0,0\n1,5\n", ""),
            ("0,0\n", "at least two"),
            ("0,0\n1,5\n1,6\n", "rise"),
            ("0,0\n1,5\n2,4\n", "rise"),
            ("0,0\n1,5\nmore,6\n", "line 3"),
            ("0,-1\n1,5\n", "negative"),
        ],
    )
    def test_strapping_tables(self, tmp_path: Path, text: str, says: str) -> None:
        file = tmp_path / "table.csv"
        file.write_text(text)
        if not says:
            assert Strapping.read(file).volume(0.5) == 2.5
            return
        with pytest.raises(InputError, match=says):
            Strapping.read(file)

    def test_lengths_that_can_not_be(self) -> None:
        bads: tuple[dict[str, Any], ...] = (
            {"diameter": math.nan},
            {"cylinder": -1.0},
            {"cone": 1e6},
            {"outlet_length": -0.1},
        )
        for bad in bads:
            with pytest.raises(UsageError):
                Datasheet(**bad)


class TestBareClouds:
    def heap(self, up: int = 2, seed: int = 0) -> np.ndarray:
        """Points on a cone of 30° on a floor, with `up` the vertical axis."""
        xy = np.random.default_rng(seed).uniform(-1.5, 1.5, (40_000, 2))
        height = np.maximum(0.8 - math.tan(math.radians(30.0)) * np.hypot(xy[:, 0] - 0.2, xy[:, 1]), 0.0)
        return np.insert(xy, up, height, axis=1)

    def test_shape_and_volume_over_the_floor(self) -> None:
        points = self.heap()
        floor = points.copy()
        floor[:, 2] = 0.0
        full, empty = (siloscope.surface_map(p) for p in (points, floor))
        volume, std = siloscope.volume_between(empty, full)
        radius = 0.8 / math.tan(math.radians(30.0))
        assert volume == pytest.approx(math.pi * radius**2 * 0.8 / 3.0, rel=0.02)
        assert 0.0 < std < 0.05 * volume
        assert siloscope.volume_between(full, empty)[0] == pytest.approx(-volume, rel=1e-3)
        inner = siloscope.surface_map(points[np.hypot(points[:, 0] - 0.2, points[:, 1]) < 1.0]).shape
        assert inner is not None
        assert inner.form == "mound"
        assert math.degrees(-inner.flank) == pytest.approx(30.0, abs=1.0)

    def test_any_vertical(self) -> None:
        for up in range(3):
            made = siloscope.surface_map(self.heap(up), np.eye(3)[up])
            assert made.height((0.2, 0.0) if up == 2 else (0.0, 0.0)).shape == ()
            assert np.nanmax(made.heights) == pytest.approx(0.8, abs=0.06)

    def test_what_is_no_cloud(self) -> None:
        for bad in (np.zeros((4, 2)), np.zeros((10, 3)), np.full((100, 3), np.nan), np.zeros((0, 3))):
            with pytest.raises(InputError):
                siloscope.surface_map(bad)
        with pytest.raises(UsageError):
            siloscope.surface_map(self.heap(), (0.0, 0.0, 0.0))
        with pytest.raises(UsageError, match="cell"):
            siloscope.surface_map(self.heap(), cell=1e-5)
        with pytest.raises(UsageError, match="verticals"):
            siloscope.volume_between(siloscope.surface_map(self.heap()), siloscope.surface_map(self.heap(), (0, 1, 1)))

    def cloud(self, name: str) -> np.ndarray:
        with siloscope.open(realdata.path("bin_content_livox", name)) as source:
            points = np.asarray(source[0].points, float).reshape(-1, 3)
        return points[np.isfinite(points).all(axis=1) & (np.abs(points).sum(axis=1) > 0.0)]

    def test_the_crater_of_a_real_bin(self) -> None:
        """README: symmetry centre (4.52, 0.55), mean slope 23.5°."""
        points = self.cloud("last_overhead_concave.pcd")
        crater = points[np.hypot(points[:, 0] - 4.52, points[:, 1] - 0.55) < 2.5]
        shape = siloscope.surface_map(crater, noise=0.02).shape
        assert shape is not None
        assert shape.form == "funnel"
        assert math.degrees(shape.flank) == pytest.approx(23.5, abs=2.0)
        assert shape.centre is not None
        assert math.hypot(shape.centre[0] - 4.52, shape.centre[1] - 0.55) < 0.25
        whole = siloscope.surface_map(points, noise=0.02).shape  # with the bin's rim about the crater
        assert whole is not None
        assert math.degrees(whole.flank) == pytest.approx(23.5, abs=2.0)

    def test_a_real_box_holds_more_when_full(self) -> None:
        empty, full = (self.cloud(f"lab_{name}.pcd") for name in ("empty_box", "full_box_scan"))
        volumes = []
        for half in (slice(0, None, 2), slice(1, None, 2)):
            maps = [siloscope.surface_map(cloud[half], noise=0.01) for cloud in (empty, full)]
            volume, std = siloscope.volume_between(*maps)
            assert volume > 10.0 * std
            volumes.append(volume)
        assert volumes[0] == pytest.approx(volumes[1], rel=0.02)
        assert 0.0 < volumes[0] < 0.48 * 0.36 * 0.23


def test_a_flat_floor() -> None:
    silo = Silo(radius=1.0, cylinder_height=2.0, cone_height=0.001)
    made = scene(Feed("mound", 0.5), silo=silo)
    content = siloscope.measure(made.render().frame(), known(made))
    assert content.volume == pytest.approx(made.render().true_volume, rel=3e-3)

"""What lies under the surface: a volume only from a bottom that is known, ullage from any surface."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import siloscope
import vessels
from silos import STOUT, known, measured, noisy, scene
from siloscope.content import products
from siloscope.simulation import Feed, Silo
from siloscope.types.calibration import FrameRecord
from siloscope.types.floor import Floor
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.floor import floor_of

STEEP = Silo(radius=1.0, cylinder_height=2.0, cone_height=1.5)


def untold(made: Any, std: float = 0.0, reach: tuple[float, float] = (0.05, 0.98)) -> siloscope.Calibration:
    """A calibration that was told nothing of its cone, and saw it bare between two fractions of its radius."""
    radius = made.silo.radius
    seen = FrameRecord(0, "frame", "used", 1.0, cone_reach=(reach[0] * radius, reach[1] * radius))
    return replace(known(made, std), floor=Floor(), frames=(seen,))


class TestRule:
    """When a conical surface that was seen is the bottom."""

    @pytest.mark.parametrize(("cone", "kind"), [(0.8, "unknown"), (1.15, "unknown"), (1.25, "cone"), (2.0, "cone")])
    def test_only_a_surface_steeper_than_feed_lies_proves_a_bottom(self, cone: float, kind: str) -> None:
        made = scene(None, silo=replace(STEEP, cone_height=cone))
        floor, _ = floor_of(untold(made, 1e-3), Datasheet())
        assert floor.kind == kind
        assert floor.seen is not None
        assert floor.seen.angle == pytest.approx(math.atan(cone))

    @pytest.mark.parametrize("reach", [(0.6, 0.98), (0.05, 0.5)])
    def test_a_steep_surface_proves_itself_only_where_it_was_seen(self, reach: tuple[float, float]) -> None:
        """Below it another stage may follow, above it a flatter one may come before."""
        made = scene(None, silo=STEEP)
        assert floor_of(untold(made, 1e-3), Datasheet())[0].hidden_std > 0.0
        assert floor_of(untold(made, 1e-3, reach), Datasheet())[0].kind == "unknown"
        assert floor_of(replace(untold(made, 1e-3), frames=()), Datasheet())[0].kind == "unknown"
        content = siloscope.measure(made.render().frame(), untold(made, 1e-3, reach))
        assert content.volume is None
        assert "--bottom cone" in (content.message or "")

    def test_an_earlier_calibration_says_what_it_lacks(self) -> None:
        """It has not recorded how far its cone was seen bare."""
        made = scene(None, silo=STEEP)
        early = replace(untold(made, 1e-3), frames=(FrameRecord(0, "frame", "used", 1.0),))
        content = siloscope.measure(made.render().frame(), early)
        assert content.volume is None
        assert "earlier version" in (content.message or "")
        assert siloscope.measure(made.render().frame(), early, bottom="cone").volume is not None

    def test_a_vague_slope_is_no_proof(self) -> None:
        made = scene(None, silo=replace(STEEP, cone_height=1.25))
        assert floor_of(untold(made, 0.1), Datasheet())[0].kind == "unknown"

    def test_a_product_that_lies_flatter_proves_more(self) -> None:
        made = scene(None, silo=replace(STEEP, cone_height=1.0))
        calibration = untold(made, 1e-3)
        wheat = replace(products()["wheat"], steepest=math.radians(35.0))
        assert siloscope.measure(made.render().frame(), calibration).floor.kind == "unknown"
        assert siloscope.measure(made.render().frame(), calibration, product=wheat).floor.kind == "cone"

    def test_what_is_said_counts(self) -> None:
        made = scene(None)
        for sheet, kind in (
            (Datasheet(bottom="cone"), "cone"),
            (Datasheet(bottom="flat"), "flat"),
            (Datasheet(cone=0.0), "flat"),
            (Datasheet(cone=1.2), "cone"),
            (Datasheet(), "unknown"),
        ):
            assert floor_of(untold(made), sheet)[0].kind == kind
        assert floor_of(known(made), Datasheet(bottom="unknown"))[0].kind == "unknown"

    def test_a_contradiction_is_a_warning_with_the_numbers(self) -> None:
        shallow, steep = scene(None), scene(None, silo=STEEP)
        floor, said = floor_of(untold(shallow, 1e-4), Datasheet(cone=0.5))
        assert floor.kind == "cone"
        assert floor.seen is None, "the surface that was seen is feed"
        assert "21.8°" in said[0].seen
        assert "43.8" in said[0].seen
        floor, said = floor_of(untold(steep, 1e-4), Datasheet(cone=0.5))
        assert floor.evidence == "steep"
        assert said[0].severity == "warning"
        floor, said = floor_of(untold(steep, 1e-4), Datasheet(bottom="flat"))
        assert floor.kind == "flat"
        assert "56°" in said[0].seen

    def test_it_is_kept_in_the_file(self, tmp_path: Any) -> None:
        made = known(scene(None))
        made.save(tmp_path / "silo.json")
        assert siloscope.Calibration.load(tmp_path / "silo.json").floor.to_dict() == made.floor.to_dict()


class TestUllage:
    @pytest.mark.parametrize("level", [0.15, 0.4, 0.75])
    @pytest.mark.parametrize("shape", ["funnel", "mound", "gaussian"])
    def test_it_needs_no_bottom(self, shape: str, level: float) -> None:
        made = noisy(scene(Feed(shape, level)))
        frame = made.render()
        content = siloscope.measure(frame.frame(), untold(made), bottom="unknown", top=0.0)
        assert content.volume is None
        assert content.volume_std is None
        assert content.missing == ("bottom",)
        truth = STOUT.capacity - frame.true_volume
        assert content.ullage == pytest.approx(truth, abs=2e-3 * STOUT.capacity)
        assert content.ullage_std is not None
        assert 0.0 < content.ullage_std < 0.02 * STOUT.capacity

    @pytest.mark.parametrize("parameter", [2, 4, 7])
    def test_its_deviation_is_what_moving_a_parameter_does(self, parameter: int) -> None:
        made = scene(Feed("gaussian+tilted", 0.6, tilt=0.1), place=(0.5, -0.2))
        frame = made.render().frame()
        calibration = untold(made)
        assert calibration.parameters is not None
        step = 2e-4
        covariance = np.zeros((12, 12))
        covariance[parameter, parameter] = step**2
        stated = siloscope.measure(frame, replace(calibration, parameter_covariance=covariance))
        ends = []
        for sign in (1.0, -1.0):
            values = calibration.parameters.copy()
            values[parameter] += sign * step
            pose, silo = siloscope.SiloPose(*values[:4]), replace(calibration.silo, radius=float(values[4]))
            ends.append(siloscope.measure(frame, replace(calibration, parameters=values, pose=pose, silo=silo)).ullage)
        change = abs((ends[0] or 0.0) - (ends[1] or 0.0)) / 2.0
        parts = stated.ullage_parts
        assert parts is not None
        part = parts.pose if parameter < 4 else parts.geometry if parameter < 7 else parts.depth
        assert part == pytest.approx(change, rel=0.1, abs=2e-6)

    def test_with_a_known_bottom_it_is_the_rest_of_the_capacity(self) -> None:
        content, _ = measured(scene(Feed("mound", 0.4)), top=0.0)
        assert content.ullage == pytest.approx((content.capacity or 0.0) - (content.volume or 0.0))
        empty, _ = measured(scene(None), top=0.0)
        assert empty.ullage == pytest.approx(empty.capacity)

    def test_changes_need_no_bottom(self) -> None:
        low, high = (scene(Feed("mound", level)) for level in (0.5, 0.55))
        one, two = (siloscope.measure(made.render().frame(), untold(made)) for made in (low, high))
        change = two.change_since(one)
        truth = high.render().true_volume - low.render().true_volume
        assert change is not None
        assert change[0] == pytest.approx(truth, rel=0.02)
        assert abs(change[0] - truth) < 4.0 * change[1]


@pytest.mark.parametrize("kind", ["flat_ring", "crater", "flat_empty", "two_stage", "pyramid", "oblique"])
@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_told_there_is_ullage_and_no_volume(kind: str, seed: int) -> None:
    """The independent oracle's vessels, with its pose and wall: ullage is what its quadrature counts."""
    seen = vessels.Seen.draw(kind, seed)
    content = siloscope.measure(seen.frame, seen.calibration(), top=seen.top)
    assert content.ok, content.message
    assert content.volume is None
    assert content.ullage is not None
    assert content.ullage_std is not None
    off = abs(content.ullage - seen.ullage)
    assert off < 0.01 * seen.capacity, (off / seen.capacity, content.coverage)
    assert off < 4.0 * content.ullage_std, (off, content.ullage_std)

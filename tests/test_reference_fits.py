"""The core's least squares against fits at 50 digits; `python -m benchmarks.reference_fits` has 200 of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from siloscope import _core

sys.path.append(str(Path(__file__).parents[1]))
from benchmarks.reference_fits import KINDS, Kind, drawn, errors


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
@pytest.mark.parametrize("seed", [1001, 1002, 1003])
def test_fits_agree_with_50_digits(kind: Kind, seed: int) -> None:
    assert max(errors(kind, seed)) < 1e-9


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_fit_begun_at_its_answer_stays_there(kind: Kind) -> None:
    data = drawn(kind, 7)
    found = _core.orthogonal_fit(data.points, data.start)
    again = _core.orthogonal_fit(data.points, found.tolist())
    assert again[np.isfinite(again)] == pytest.approx(found[np.isfinite(found)], rel=1e-10, abs=1e-9)


def test_points_that_fix_no_wall_are_refused() -> None:
    start = drawn(KINDS[0], 1).start
    with pytest.raises(ValueError, match="do not fix"):
        _core.orthogonal_fit(np.zeros((0, 3)), start)

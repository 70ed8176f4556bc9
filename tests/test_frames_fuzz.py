"""Mutated files end in frames or in an error that names the file; the long run is ``python -m tests.fuzz_frames``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fuzz_frames
from siloscope import InputError

MUTATIONS = 150


@pytest.mark.parametrize("name", fuzz_frames.SEEDS)
def test_mutated_files_break_no_rule(name: str, tmp_path: Path) -> None:
    assert list(fuzz_frames.fuzz(name, MUTATIONS, seed=1, folder=tmp_path)) == []


@pytest.mark.parametrize("name", fuzz_frames.SEEDS)
def test_good_files_break_no_rule_and_some_mutations_are_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(fuzz_frames.SEEDS[name]())
    assert fuzz_frames.broken_rule(path) is None
    path.write_bytes(path.read_bytes()[:3])
    with pytest.raises(InputError):
        fuzz_frames.read(path)


def test_the_rules_notice_what_they_are_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"content")

    def breaks(action: object) -> str:
        monkeypatch.setattr(fuzz_frames, "read", action)
        return fuzz_frames.broken_rule(path) or ""

    def hang(_: Path) -> None:
        while True:
            pass

    def crash(_: Path) -> None:
        raise KeyError("x")

    def fill(_: Path) -> None:
        np.ones(fuzz_frames.FLOOR_BYTES)

    assert "KeyError" in breaks(crash)
    assert "memory" in breaks(fill)
    monkeypatch.setattr(fuzz_frames, "LONGEST_S", 0.05)
    assert "longer" in breaks(hang)

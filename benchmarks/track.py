"""Does `track` tell a month right? Refills that never were, refills that it misses, and whether the forecast holds.

    python -m benchmarks.track --months 20

A month is a story of hourly stored readings (`tests/stories.py`): use that varies from day to day, deliveries in one
or two loads, dust after them, outages, strayed readings, a lens that gets dirty, and in half of the months a camera
that is moved. Asked is what the public functions of stored readings tell of it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import stories
from siloscope.tracking.story import track_of
from siloscope.types.track import DAY, Reading

CUTS = (7.0, 11.0, 15.0, 19.0, 23.0, 27.0)
"""Days after which the silo's end is forecast."""


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--months", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first month")
    parser.add_argument("--ullage", action="store_true", help="the bottom is not known")
    chosen = parser.parse_args()
    months = [stories.draw(seed) for seed in range(chosen.first, chosen.first + chosen.months)]
    false = missed = deliveries = 0
    held: list[bool] = []
    for number, story in enumerate(months, chosen.first):
        found = tuple(
            (e.start or 0.0, e.end or 0.0)
            for e in track_of(_known(story.readings, chosen.ullage), capacity=story.capacity).events
            if e.kind == "refill"
        )
        wrong = stories.refills(story, found)
        if any(wrong):
            print(f"month {number}: {wrong[0]} false, {wrong[1]} missed")
        false, missed, deliveries = false + wrong[0], missed + wrong[1], deliveries + len(story.deliveries)
        held += [] if chosen.ullage else _forecasts(story)
    print(
        f"{chosen.months} months, {deliveries} deliveries: {false} false refills, {missed} missed over 2 % of capacity"
    )
    if held:
        print(f"empty-by band holds in {100 * np.mean(held):.0f} % of {len(held)} forecasts")


def _known(readings: tuple[Reading, ...], ullage: bool) -> tuple[Reading, ...]:
    return tuple(replace(r, volume=None, volume_std=None) for r in readings) if ullage else readings


def _forecasts(story: stories.Story) -> list[bool]:
    """Whether the band of each forecast holds the truth."""
    held = []
    for day in CUTS:
        found = track_of(stories.until(story, day), capacity=story.capacity)
        if found.use is None or found.use.earliest is None:
            continue
        truth = story.empty_at(stories.START + DAY * day)
        held.append(found.use.earliest <= truth <= (found.use.latest or np.inf))
    return held


if __name__ == "__main__":
    main()

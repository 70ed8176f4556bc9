"""Settings of PCL and CGAL, tried on every fifth frame: how `methods.SETTINGS` were found.

python benchmarks/peers/tune.py
"""

from __future__ import annotations

import numpy as np
from frames import Shown, scenes, shown
from methods import PRIOR, compiled
from rich.console import Console
from rich.table import Table
from score import distances

CHOICES = {
    "pcl": [(d, w) for d in (0.02, 0.05, 0.08) for w in (0.05, 0.1, 0.3)],
    "cgal": [(e, n) for e in (0.01, 0.02, 0.04) for n in (0.8, 0.9, 0.95)],
}
"""Distance and weight of the normals (PCL), distance and least cosine (CGAL)."""

REPEATS = 2


def main() -> None:
    """Prints a row a choice."""
    frames = [shown(*scene)[0] for scene in list(scenes())[::5]]
    table = Table("library", "settings", "time, ms", "distance, mm", "worst", "no answer")
    for library, choices in CHOICES.items():
        for settings in choices:
            table.add_row(library, str(settings), *_tried(library, settings, frames))
    Console().print(table)


def _tried(library: str, settings: tuple[float, float], frames: list[Shown]) -> list[str]:
    answers = [(frame, compiled(library, PRIOR, settings)(frame, REPEATS)) for frame in frames]
    off = np.array([1e3 * value for frame, found in answers for value in distances(frame, found)])
    times = [one.ms for _, found in answers for one in found]
    return [
        f"{np.median(times):.0f}",
        f"{np.nanmedian(off):.2f}",
        f"{np.nanmax(off):.0f}",
        f"{np.count_nonzero(np.isnan(off))} of {len(off)}",
    ]


if __name__ == "__main__":
    main()

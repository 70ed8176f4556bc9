"""How close the answers come to the Cramér-Rao bound, for silo and feed level, 20 frames each.

    python -m benchmarks.crb --write

The figure of a cell is the root mean square over its frames of √(eᵀ B⁻¹ e / 4), e the error of (r_x, r_y, t_x, t_y) and
B the bound's covariance of them: 1 is what no unbiased estimator can beat.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks import trials
from benchmarks.trials import KNOWN

from siloscope.reproduction.bound import cramer_rao
from siloscope.simulation import ASTRA_S, Feed, SimulatedFrame
from siloscope.simulation.scenarios import scenario

NAMES = ("silo1", "silo2", "silo3", "silo-r1", "silo-r2")
LEVELS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def ratio(frame: SimulatedFrame) -> float:
    """√(eᵀ B⁻¹ e / 4) of one frame; NaN where it is refused."""
    estimate = KNOWN.locate(frame)
    if estimate.pose is None:
        return float("nan")
    error, bound = trials.pose_error(estimate, frame.scene), cramer_rao(frame)[:4, :4]
    scale = np.sqrt(np.diag(bound))
    return float(np.sqrt((error / scale) @ np.linalg.solve(bound / scale / scale[:, None], error / scale) / 4.0))


def cell(name: str, level: float, frames: int, jobs: int) -> np.ndarray:
    """Ratios of the frames of one silo at one level; only the noise differs."""
    feed = Feed("gaussian", level) if level > 0.0 else None
    first = replace(scenario(name), feed=feed, sensor=ASTRA_S).render()
    return np.array(list(trials.each([first.measured_again(k) for k in range(frames)], ratio, jobs, f"{name} {level}")))


def main() -> None:
    """Prints the table; with --write puts it into the manual."""
    options = trials.arguments(__doc__, frames=20)
    lines, cells = [], []
    for name in NAMES:
        line = [name]
        for level in LEVELS:
            found = cell(name, level, options.frames, options.jobs)
            seen = found[np.isfinite(found)]
            rms = float(np.sqrt(np.mean(seen**2))) if len(seen) else float("nan")
            cells.append(rms)
            lost = f" ({len(found) - len(seen)} refused)" if len(seen) < len(found) else ""
            line.append(f"{rms:.2f}{lost}" if len(seen) else "refused")
        lines.append(line)
    head = ("error over bound", *(f"{100 * level:.0f} %" for level in LEVELS))
    text = trials.table(head, lines)
    median, worst = np.nanmedian(cells), np.nanmax(cells)
    trials.publish(
        "bound", f"{text}\n\nMedian {median:.2f} (goal 1.5), worst {worst:.2f}.", options.write, "benchmarks.crb"
    )


if __name__ == "__main__":
    main()

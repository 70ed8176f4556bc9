"""Section 3.5: running time on the last frames."""

from __future__ import annotations

import statistics

from siloscope.reproduction.discharges import Discharge
from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.chapter import Chapter, Verdict
from siloscope.reproduction.evaluation.five_silos import silos
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.tables import Cell, Table, number
from siloscope.reproduction.jobs import Job
from siloscope.reproduction.running import Results
from siloscope.reproduction.solvers import ALL, SOLVERS
from siloscope.reproduction.timing import REPEATS, Timing, machine

INTRODUCTION = f"""
The last frame of each discharge, where the silo is empty, from a depth array in memory to the answer, on one thread:
the median of {REPEATS} runs. Times are of the machine that made this page; the paper's are of a laptop and of Python.
"""


def jobs(plan: Plan) -> list[Job]:
    """A timing a silo."""
    return [_timing(silo, plan) for silo in silos()]


def _timing(silo: Discharge, plan: Plan) -> Timing:
    return Timing(silo.trials(plan.steps)[-1].scene, silo.profile, plan.few(REPEATS))


def chapter(plan: Plan, results: Results) -> Chapter:
    """What came out."""
    seconds = {silo.name: results[_timing(silo, plan)] for silo in silos()}
    rows: list[tuple[Cell, ...]] = [(name, *(1e3 * times[m] for m in ALL)) for name, times in seconds.items()]
    mean = {m: statistics.mean(times[m] for times in seconds.values()) for m in ALL}
    rows.append(("mean", *(1e3 * mean[m] for m in ALL)))
    head = ("last frame of", *(f"{SOLVERS[name].heading}, ms" for name in ALL))
    title = f"Running time, one thread; the paper's mean is {published.RUNNING_TIME:g} s"
    table = Table("timing", title, head, tuple(rows), f"Machine: {machine()}.")
    return Chapter("Running time (section 3.5)", (INTRODUCTION, table), (_verdict(mean),))


def _verdict(mean: dict[str, float]) -> Verdict:
    faster = published.RUNNING_TIME / mean["shape-tensor"]
    return Verdict(
        "Mean running time of a frame",
        f"{published.RUNNING_TIME:g} s",
        f"{number(1e3 * mean['shape-tensor'])} ms (shape-tensor), {number(1e3 * mean['surface'])} ms (surface)",
        "better" if faster > 2.0 else "agrees" if faster > 0.5 else "worse",
        f"{number(faster)} times as fast, in compiled code and on another machine.",
    )

"""The time of `locate` by step, one thread and two, with a PNG decode and start-up times from the same run beside it.

    python benchmarks/locate.py [--repeat N]

All times are the least of the repeats, as other work on the machine only adds to them, and medians over the frames.
"""

from __future__ import annotations

import argparse
import io
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console
from rich.table import Table

import siloscope
from siloscope.estimation import steps
from siloscope.estimation.region import frame_points
from siloscope.simulation import ASTRA_S, Scene, SimulatedFrame
from siloscope.simulation.metrics import pc_average_distance
from siloscope.simulation.scenarios import random_scene, scenario
from siloscope.types.camera import Camera

SCENARIOS = ("silo1", "silo2", "silo-r1")
METHODS: tuple[tuple[str, str | None], ...] = (("surface", "orbbec-astra-s"), ("shape-tensor", None))

GOAL_POINT, GOAL_FRAME = 0.004, 10.0
"""What the six steps may take at k = 30: ms a grid point, and ms a frame."""

GOALS = {"silo1": (0.66, 14.1), "silo2": (1.0, 75.0), "silo3": (0.96, 27.7)}
"""What they must reach on perfect and perturbed frames with the paper's feed at 10 %, mm."""

GOAL_UNSEEN, UNSEEN = 3.0, 20
"""The same for silos nobody has seen, perfect, mm; and how many are tried."""

STRIDE = 37
"""Every so many points are asked for their PC average distance."""


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=11)
    repeat = parser.parse_args().repeat
    console = Console(width=110)
    frames = [replace(scenario(name), sensor=ASTRA_S).render(threads=2) for name in SCENARIOS]
    decode = statistics.median(decode_time(seen, repeat) for seen in frames)
    console.print(whole_times(frames, decode, repeat))
    for method, sensor in METHODS:
        console.print(step_times(frames, method, sensor, repeat))
    console.print(six_steps(repeat))
    console.print(distances())
    console.print(scaling(repeat))
    console.print(start_up(repeat))
    console.print(memory(frames))


def milliseconds(run: Callable[[], object], repeat: int) -> float:
    """Least time of a call: what else the machine does only adds to it."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times)


def decode_time(seen: SimulatedFrame, repeat: int) -> float:
    """Pillow decoding the frame's 16-bit PNG."""
    buffer = io.BytesIO()
    Image.fromarray(seen.raw(0.001)).save(buffer, "PNG")
    return milliseconds(lambda: np.asarray(Image.open(io.BytesIO(buffer.getvalue()))), repeat)


def located(seen: SimulatedFrame, method: str, sensor: str | None, threads: int = 1) -> siloscope.Estimate:
    """One call of `locate` with the depth array in memory."""
    depth = seen.measured
    return siloscope.locate(depth, seen.camera, method=method, sensor=sensor, threads=threads)


def whole_times(frames: Sequence[SimulatedFrame], decode: float, repeat: int) -> Table:
    """Each method, one thread and two, against the PNG decode."""
    table = Table(title="depth array to pose (ms)", title_justify="left")
    for head in ("method", *SCENARIOS, "median", "PNG decodes", "2 threads", "speed-up"):
        table.add_column(head, justify="left" if head == "method" else "right")
    for method, sensor in METHODS:
        one, two = (
            [milliseconds(lambda: located(seen, method, sensor, threads), repeat) for seen in frames]  # noqa: B023
            for threads in (1, 2)
        )
        middle, pair = statistics.median(one), statistics.median(two)
        cells = [f"{value:.2f}" for value in (*one, middle)]
        table.add_row(method, *cells, f"{middle / decode:.2f}", f"{pair:.2f}", f"{middle / pair:.2f}")
    table.add_row("PNG decode", *[""] * len(SCENARIOS), f"{decode:.2f}", "1.00", "", "")
    return table


def step_times(frames: Sequence[SimulatedFrame], method: str, sensor: str | None, repeat: int) -> Table:
    """The estimate's own clock, step by step."""
    table = Table(title=f"{method} by step (ms)", title_justify="left")
    table.add_column("step")
    for name in SCENARIOS:
        table.add_column(name, justify="right")
    runs = [[located(seen, method, sensor).timing_ms for _ in range(repeat)] for seen in frames]
    for step in runs[0][0]:
        middles = [statistics.median(timing.get(step, 0.0) for timing in timings) for timings in runs]
        table.add_row(step, *[f"{value:.3f}" for value in middles])
    return table


def six_steps(repeat: int) -> Table:
    """The six steps on perfect frames: by point of the voxel grid, and against the slow NumPy reference."""
    reference = slow_reference()
    table = Table(title="shape-tensor on perfect frames", title_justify="left")
    table.add_column("")
    rows: dict[str, list[str]] = {
        name: [] for name in ("grid points", "ms", "goal, ms", "reference, ms", "times faster", "by 2 threads")
    }
    for name in SCENARIOS:
        table.add_column(name, justify="right")
        seen = scenario(name).render(threads=2)
        points = frame_points(seen.frame()).reshape(-1, 3)
        count = len(steps.voxel_grid(points))
        taken, pair = (
            milliseconds(lambda: located(seen, "shape-tensor", None, threads), repeat)  # noqa: B023
            for threads in (1, 2)
        )
        slow = milliseconds(lambda: reference(points), 1)  # noqa: B023
        goal = f"≤ {GOAL_POINT * count + GOAL_FRAME:.2f}"
        cells = (f"{count}", f"{taken:.2f}", goal, f"{slow:.0f}", f"{slow / taken:.0f}", f"{taken / pair:.2f}")
        for row, cell in zip(rows.values(), cells, strict=True):
            row.append(cell)
    for name, row in rows.items():
        table.add_row(name, *row)
    return table


def distances() -> Table:
    """PC average distance (Eq. 11) of the six steps with its goals: the paper's silos, the worst of unseen ones."""
    table = Table(title="shape-tensor: PC average distance (mm)", title_justify="left")
    for head in ("silo", "perfect", "goal", "perturbed", "goal"):
        table.add_column(head, justify="left" if head == "silo" else "right")
    for name, (perfect, perturbed) in GOALS.items():
        scene = scenario(name)
        noisy = max(distance(replace(scene, sensor=ASTRA_S, seed=seed)) for seed in range(3))
        table.add_row(name, f"{distance(scene):.2f}", f"≤ {perfect:g}", f"{noisy:.2f}", f"≤ {perturbed:g}")
    worst = max(distance(random_scene(seed)) for seed in range(UNSEEN))
    table.add_row(f"worst of {UNSEEN} unseen", f"{worst:.2f}", f"≤ {GOAL_UNSEEN:g}", "", "")
    return table


def distance(scene: Scene) -> float:
    """Over the frame's own cloud, mm; NaN where refused."""
    seen = scene.render(threads=2)
    pose = located(seen, "shape-tensor", None).pose
    if pose is None:
        return float("nan")
    return 1e3 * pc_average_distance(pose, scene.pose, seen.measured, seen.camera, stride=STRIDE)


def slow_reference() -> Callable[[np.ndarray], np.ndarray]:
    """The tests' oracle."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    import reference

    return lambda points: reference.locate(points[np.isfinite(points).all(axis=1)])


def scaling(repeat: int) -> Table:
    """Twice the pixels, the same scene."""
    table = Table(title="twice the pixels (ms)", title_justify="left")
    for head in ("method", "640 x 480", "905 x 679", "ratio"):
        table.add_column(head, justify="left" if head == "method" else "right")
    small = replace(scenario("silo1"), sensor=ASTRA_S)
    frames = [small.render(threads=2), finer(small, 2.0**0.5).render(threads=2)]
    for method, sensor in METHODS:
        times = [milliseconds(lambda: located(seen, method, sensor), repeat) for seen in frames]  # noqa: B023
        table.add_row(method, *[f"{value:.2f}" for value in times], f"{times[1] / times[0]:.2f}")
    return table


def finer(scene: Scene, factor: float) -> Scene:
    """The scene through a camera of the same view and more pixels."""
    old = scene.camera
    width, height = round(old.width * factor), round(old.height * factor)
    centre = ((width - 1) / 2, (height - 1) / 2)
    return replace(scene, camera=Camera(width, height, old.fx * factor, old.fy * factor, *centre))


def start_up(repeat: int) -> Table:
    """Import and help in a new process."""
    table = Table(title="start-up (ms)", title_justify="left")
    for head in ("what", "ms", "goal"):
        table.add_column(head, justify="left" if head == "what" else "right")
    goals = (["-c", "pass"], ""), (["-c", "import siloscope"], "≤ 300"), (["-m", "siloscope", "--help"], "≤ 500")
    for what, goal in goals:
        command = [sys.executable, *what]
        taken = milliseconds(lambda: subprocess.run(command, capture_output=True, check=True), repeat)  # noqa: B023
        table.add_row("python " + " ".join(what), f"{taken:.0f}", goal)
    return table


PEAK = """
import re, sys
def peak():
    return int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
start = peak()
import numpy as np, siloscope
held = np.load(sys.argv[1])
camera = siloscope.Camera(**eval(sys.argv[2]))
siloscope.locate(held, camera, method=sys.argv[3])
print((peak() - start) / 1024)
"""
"""Run in a process of its own, on Linux."""


def memory(frames: Sequence[SimulatedFrame]) -> Table:
    """Peak memory of one `locate` above the interpreter's start, imports and frame included."""
    table = Table(title="peak memory above the interpreter's start (MB)", title_justify="left")
    for head in ("method", SCENARIOS[0], "goal"):
        table.add_column(head, justify="left" if head == "method" else "right")
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/frame.npy"
        np.save(path, frames[0].measured)
        for method, _ in METHODS:
            command = [sys.executable, "-c", PEAK, path, repr(frames[0].camera.to_dict()), method]
            done = subprocess.run(command, capture_output=True, check=True, text=True)
            table.add_row(method, f"{float(done.stdout):.0f}", "≤ 150")
    return table


if __name__ == "__main__":
    main()

"""How often is an answer sure and wrong? Populations by kind that no one tuned to, from the tests' independent oracle.

    python -m benchmarks.populations --frames FOLDER --seeds 0:6 --kinds oblique,bent --modes SDN --jobs 2
    python -m benchmarks.populations --frames FOLDER --sequences 0:2

The frames are traced once and kept in FOLDER, outside the repository; change the seeds to get scenes that nobody has
seen. "all" kinds are the silos', "no-silo" those that are none. Known is, by mode, S the sensor's profile, D the
diameter alone, N nothing, I the profile and the exact intrinsics; in S, D and N the told intrinsics are off as a
calibration's are, or as the kind says. Columns:

- missed: refused though at least a quarter of the readings shows the wall;
- wrong: a pose parameter is off by more than 4 stated deviations and more than 10 mm or 5 mrad;
- within 2: share of the four pose parameters within 2 stated deviations; worst z: largest error in deviations;
- mm, mrad: error of the camera's place and of the axis' direction; std: what is stated of both, median;
- geometry wrong: radius, cylinder's bottom or apex off by more than 4 deviations and 10 mm, or a wrong kind of bottom;
- time: processor time of `locate` over that of Pillow decoding the frame's PNG.
"""

from __future__ import annotations

import argparse
import inspect
import io
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import siloscope
from siloscope import Camera, Frame

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracle import KINDS, NO_SILO, store
from oracle.judging import HEAD, Verdict, judge, row

MODES = {
    "S": "the sensor's profile",
    "D": "the diameter alone",
    "N": "nothing",
    "I": "the profile and exact intrinsics",
}
FRAMES = 20
"""Frames of a sequence."""

INTRINSICS = "intrinsics" in inspect.signature(siloscope.locate).parameters
"""Whether the product can be told how exact the intrinsics are."""


@dataclass(frozen=True)
class Judged:
    """An answer with its verdict, its time in PNG decodes, the moves that it tells, and if the camera was moved."""

    kind: str
    seed: int
    mode: str
    verdict: Verdict
    time: float = 0.0
    moves: int = 0
    moved: bool = False


def camera_of(truth: dict[str, Any], mode: str) -> Camera:
    """The camera as the product is told of it."""
    told = dict(truth["true" if mode == "I" else "told"])
    k1 = told.pop("k1")
    return Camera(**told, distortion_model="brown_conrady", distortion=(k1, 0, 0, 0, 0)) if k1 else Camera(**told)


def knowledge(truth: dict[str, Any], mode: str) -> dict[str, Any]:
    """Arguments of `locate` and `calibrate` for a mode."""
    known: dict[str, Any] = {"sensor": truth["sensor"]} if mode in "SI" else {}
    if mode == "D":
        known["diameter"] = 2.0 * truth["silo"]["radius"] if truth["silo"] else 2.0
    if mode == "I" and INTRINSICS:
        known["intrinsics"] = "exact"
    return known


def located(folder: Path, width: int, modes: str, item: tuple[str, int]) -> list[Judged]:
    """One frame answered in every mode."""
    kind, seed = item
    sample = store.single(folder, kind, seed, width)
    depth = sample.depth.astype(np.float32) * 1e-3
    decode = _decoding(sample.depth)
    found = []
    for mode in modes:
        camera, known = camera_of(sample.truth, mode), knowledge(sample.truth, mode)
        camera.rays()
        start = time.process_time()
        answer = siloscope.locate(depth, camera, **known)
        ratio = (time.process_time() - start) / decode
        found.append(Judged(kind, seed, mode, judge(answer.to_dict(), sample.truth), ratio))
    return found


def calibrated(folder: Path, width: int, modes: str, moved: bool, item: tuple[str, int]) -> list[Judged]:
    """One sequence fused in every mode; where the camera was moved, the last pose is the true one."""
    kind, seed = item
    samples = store.many(folder, kind, seed, FRAMES, width, moved)
    last = samples[-1].truth
    found = []
    for mode in modes:
        camera = camera_of(last, mode)
        frames = [Frame(depth=s.depth.astype(np.float32) * 1e-3, camera=camera) for s in samples]
        answer = siloscope.calibrate(frames, **knowledge(last, mode))
        found.append(Judged(kind, seed, mode, judge(answer.to_dict(), last), moves=len(answer.moves), moved=moved))
    return found


def _decoding(depth: np.ndarray) -> float:
    buffer = io.BytesIO()
    Image.fromarray(depth).save(buffer, "PNG")
    times = []
    for _ in range(3):
        start = time.process_time()
        np.asarray(Image.open(io.BytesIO(buffer.getvalue())))
        times.append(time.process_time() - start)
    return statistics.median(times)


def tables(judged: list[Judged], list_all: bool) -> Iterator[str]:
    """A Markdown table for each mode, and the answers that are wrong."""
    moving = any(j.moves or j.moved for j in judged)
    head = ("kind", "n", *HEAD, *(("moves told", "moves made") if moving else ("time",)))
    for mode in dict.fromkeys(j.mode for j in judged):
        of_mode = [j for j in judged if j.mode == mode]
        yield f"\n{mode}: {MODES[mode]} known\n"
        yield "| " + " | ".join(head) + " |\n|---|" + "--:|" * (len(head) - 1)
        groups = {kind: [j for j in of_mode if j.kind == kind] for kind in dict.fromkeys(j.kind for j in of_mode)}
        for name, group in {**groups, "**all**": of_mode}.items():
            end = (sum(j.moves for j in group), sum(j.moved for j in group)) if moving else (_median_time(group),)
            cells = (name, len(group), *row([j.verdict for j in group]), *end)
            yield "| " + " | ".join(map(str, cells)) + " |"
    for j in judged:
        if list_all or j.verdict.wrong or j.verdict.geometry_wrong:
            yield line(j)


def _median_time(group: list[Judged]) -> str:
    return f"{statistics.median(j.time for j in group):.1f}"


def line(j: Judged) -> str:
    """One answer as text."""
    v = j.verdict
    what = "wrong" if v.wrong else "geometry wrong" if v.geometry_wrong else "missed" if v.missed else "fine"
    if not v.z:
        return f"  {what}: {j.kind} {j.seed} {j.mode} {v.reason or 'answered'}"
    z = " ".join(f"{each:+.1f}" for each in v.z)
    size = f"{v.position_mm:.1f} ± {v.std_mm:.2f} mm, {v.rotation_mrad:.2f} ± {v.std_mrad:.2f} mrad"
    return f"  {what}: {j.kind} {j.seed} {j.mode} {size}, z {z}"


def _range(text: str) -> range:
    first, _, end = text.partition(":")
    return range(int(first), int(end)) if end else range(int(first), int(first) + 1)


def _kinds(text: str) -> list[str]:
    groups = {"all": list(KINDS), "no-silo": list(NO_SILO)}
    names = [name for part in text.split(",") for name in groups.get(part, [part])]
    unknown = [name for name in names if name not in KINDS and name not in NO_SILO]
    if unknown:
        sys.exit(f"unknown kind '{unknown[0]}'; known are all, no-silo, {', '.join([*KINDS, *NO_SILO])}")
    return names


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", type=Path, required=True, help="folder that keeps the frames")
    parser.add_argument("--seeds", type=_range, default=range(6), help="A:B, or one")
    parser.add_argument("--sequences", type=_range, help=f"A:B: sequences of {FRAMES} frames in place of single ones")
    parser.add_argument("--moved", action="store_true", help="the camera is moved in every sequence")
    parser.add_argument("--kinds", type=_kinds, default=_kinds("all"), help="names joined by commas, all, no-silo")
    parser.add_argument("--modes", default="S", help="letters of S, D, N, I")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="list every answer")
    parser.add_argument("--json", type=Path, help="write every verdict into a file")
    options = parser.parse_args()
    work: Callable[[tuple[str, int]], list[Judged]]
    if options.sequences is None:
        work = partial(located, options.frames, options.width, options.modes)
    else:
        work = partial(calibrated, options.frames, options.width, options.modes, options.moved)
    items = [(kind, seed) for kind in options.kinds for seed in options.sequences or options.seeds]
    judged: list[Judged] = []
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        for number, found in enumerate(pool.map(work, items), 1):
            judged += found
            if sys.stderr.isatty():
                print(f"\r{number}/{len(items)}", end="", file=sys.stderr)
    print("\n".join(tables(judged, options.list)))
    if options.json:
        options.json.write_text(json.dumps([asdict(j) for j in judged], indent=1))


if __name__ == "__main__":
    main()

"""Compares today's results with the ones kept in `golden.json.xz`, to the last bit.

    python tests/golden/golden.py            compares; names what differs and exits with 1
    python tests/golden/golden.py --renew    writes the file anew: only where a commit changes answers on purpose;
                                             with `--only`, those cases of it

`--sums` allows 1e-12, relative: only where a commit changes the order of a summation and says so. `--only TEXT` runs
the cases whose name contains it. Results of recordings by others are compared where the recordings are there.

The last bits depend on the processor: NumPy and the C library choose their sine and square by its instructions. On
another kind than the one that wrote the file, write one with the commit before and compare with that: `--file FILE`.
"""

from __future__ import annotations

import argparse
import json
import lzma
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from cases import cases
from plain import RELATIVE, differences, distance, plain

KEPT = Path(__file__).with_name("golden.json.xz")
RECORDINGS = "recordings/"
SHOWN = 30
"""Differences that are listed."""

Results = dict[str, Any]


def one(name: str) -> Any:
    """The results of a case."""
    try:
        return {key: plain(result) for key, result in cases()[name]().items()}
    except Exception as error:
        error.add_note(f"in the case {name}")
        raise


def run(names: list[str], workers: int) -> Results:
    """The results of cases, in other processes."""
    found: Results = {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context) as pool:
        waiting = {pool.submit(one, name): name for name in names}
        for future in as_completed(waiting):
            found[waiting[future]] = future.result()
    return {name: found[name] for name in sorted(found)}


def read(file: Path) -> Results:
    """The results that were kept."""
    found: Results = json.loads(lzma.decompress(file.read_bytes()))
    return found


def write(file: Path, results: Results) -> None:
    """Keeps results; floats in the shortest form that reads back as the same number."""
    lines = ",\n".join(f"{json.dumps(name)}:{json.dumps(found, allow_nan=False)}" for name, found in results.items())
    file.write_bytes(lzma.compress(f"{{\n{lines}\n}}\n".encode(), preset=9))


def compared(old: Results, new: Results, tolerance: float) -> Iterator[tuple[str, str, Any, Any]]:
    """Case, key, old and new value of all differences."""
    for name in [*old, *(name for name in new if name not in old)]:
        for key, before, after in differences(old.get(name), new.get(name), tolerance):
            yield name, key, before, after


def report(found: list[tuple[str, str, Any, Any]]) -> None:
    """What differs: the first lines, then how many cases of each kind and how far."""
    for name, key, before, after in found[:SHOWN]:
        apart = distance(before, after)
        far = f"  ({apart:.1e} apart)" if apart < float("inf") else ""
        print(f"{name}: {key}: {before!r} -> {after!r}{far}")
    if len(found) > SHOWN:
        print(f"... and {len(found) - SHOWN} more")
    kinds = Counter({name.rsplit("/", 1)[0] for name, *_ in found})
    changed = {name for name, *_ in found}
    farthest = max(distance(before, after) for *_, before, after in found)
    print(f"{len(found)} values of {len(changed)} cases differ; farthest {farthest:.1e}; in {', '.join(sorted(kinds))}")


def options() -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--renew", action="store_true", help="write the file anew")
    parser.add_argument("--sums", action="store_true", help=f"allow {RELATIVE:g}, relative, for reordered sums")
    parser.add_argument("--only", default="", metavar="TEXT", help="cases whose name contains it")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--file", type=Path, default=KEPT, help="where results are kept")
    return parser.parse_args()


def main() -> int:
    """Exit code."""
    chosen = options()
    names = [name for name in cases() if chosen.only in name]
    start = time.perf_counter()
    new = run(names, chosen.workers)
    print(f"{len(new)} cases in {time.perf_counter() - start:.0f} s")
    if chosen.renew:
        write(chosen.file, dict(sorted({**(read(chosen.file) if chosen.only else {}), **new}.items())))
        return 0
    old = {name: found for name, found in read(chosen.file).items() if chosen.only in name}
    skipped = [name for name in old if name.startswith(RECORDINGS) and name not in new]
    old = {name: found for name, found in old.items() if name not in skipped}
    if skipped:
        print(f"{len(skipped)} recordings by others are not here; skipped")
    found = list(compared(old, new, RELATIVE if chosen.sums else 0.0))
    if found:
        report(found)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

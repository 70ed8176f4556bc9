"""Which frame is located when, from where, and with how many of its pixels; the answers in the frames' order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from siloscope.errors import InputError
from siloscope.estimation.decimation import decimated
from siloscope.fusion.located_frame import LocatedFrame
from siloscope.fusion.settings import Settings
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

Result = TypeVar("Result")

FULL_SEARCH_PERIOD = 16
"""Frames from one that is searched for the wall to the next; the others look first where such a frame has shown it."""

FULL_RES_FRAMES = 16
"""Frames at the beginning that count with all their pixels. Later ones add little and count with a quarter of them."""


Located = tuple[LocatedFrame, Estimate | None]
"""A frame's answer, and the estimate from which others may start."""


@dataclass(frozen=True)
class FrameLocator:
    """Locates the frames of a calibration, each by itself."""

    locate: Callable[..., Estimate]
    camera: Camera | None
    depth_unit: float | None
    settings: Settings

    def __call__(self, number: int, frame: Any, start: Estimate | None) -> Located:
        """The answer of the frame of a number, looked for first where `start` has the wall."""
        if isinstance(frame, Estimate):
            return _kept(f"estimate {number}", None, frame, made=False), None
        name = frame.source if isinstance(frame, Frame) else f"frame {number}"
        timestamp = frame.timestamp if isinstance(frame, Frame) else None
        try:
            estimate = self._estimate(number, frame, start)
        except InputError as error:
            return LocatedFrame(name, timestamp, None, error), None
        camera = self.camera or (frame.camera if isinstance(frame, Frame) else None)
        return _kept(name, timestamp, estimate, camera=camera), estimate

    def _estimate(self, number: int, frame: Any, start: Estimate | None) -> Estimate:
        common, unit = self.settings, self.depth_unit
        known: dict[str, Any] = {"diameter": common.diameter, "gravity": common.gravity, "depth_unit": unit}
        known |= {"sensor": common.profile, "start": start, "ratios": False, "intrinsics": common.intrinsics}
        few = self._decimated(frame, known) if number >= FULL_RES_FRAMES else None
        return few or self.locate(frame, self.camera, **known)

    def _decimated(self, frame: Any, known: dict[str, Any]) -> Estimate | None:
        """The answer of a quarter of a frame's pixels, where they give one."""
        few = decimated(frame, self.camera)
        try:
            estimate = None if few is None else self.locate(few, **known)
        except InputError:  # all the pixels tell better what is wrong
            return None
        return estimate if estimate is not None and estimate.ok else None


def _kept(
    name: str, timestamp: float | None, estimate: Estimate, camera: Camera | None = None, made: bool = True
) -> LocatedFrame:
    """What a calibration keeps of an estimate."""
    bare = replace(estimate, details=None)
    return LocatedFrame(name, timestamp, bare, None, camera, estimate.evidence, estimate.cone_reach, made=made)


def located(frames: Iterable[Any], one: FrameLocator, pool: Executor | Inline, ahead: int) -> Iterator[LocatedFrame]:
    """The located frames in order; up to `ahead` further frames are read and located in `pool`.

    The order alone decides which frame starts from which answer, so the pool changes no answer.
    """
    waiting: deque[Future[Located] | Done[Located]] = deque()
    starts = WarmStartSchedule()
    for number, frame in enumerate(frames):
        waiting.append(pool.submit(one, number, frame, starts.of(number)))
        starts.add(number, waiting[-1])
        if len(waiting) > ahead:
            yield waiting.popleft().result()[0]
    while waiting:
        yield waiting.popleft().result()[0]


class WarmStartSchedule:
    """Start of each frame: a fully searched frame has none, the others start from the last but one searched frame.

    The last searched frame may still be in work; only the first frames of each resolution wait for it.
    """

    def __init__(self) -> None:
        self.searched: deque[Future[Located] | Done[Located]] = deque()
        self.start: Estimate | None = None

    def of(self, number: int) -> Estimate | None:
        """Where the frame of a number starts."""
        if number % FULL_SEARCH_PERIOD == 0:
            return None
        first = any(0 <= number - begin < FULL_SEARCH_PERIOD for begin in (0, FULL_RES_FRAMES))
        while len(self.searched) > (0 if first else 1):
            found = self.searched.popleft().result()[1]
            self.start = found if found is not None and found.ok else self.start
        return self.start

    def add(self, number: int, answer: Future[Located] | Done[Located]) -> None:
        """Takes the answer of a frame that will be one to start from."""
        if number % FULL_SEARCH_PERIOD == 0:
            self.searched.append(answer)


@contextmanager
def pool_of(jobs: int) -> Iterator[Executor | Inline]:
    """A pool of `jobs` threads; this thread for one job."""
    if jobs == 1:
        yield Inline()
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(jobs) as pool:
        yield pool


class Inline:
    """Does the work at once, in this thread; stands for a pool."""

    def submit(self, work: Callable[..., Result], /, *given: Any) -> Done[Result]:
        """The work, done."""
        return Done(work(*given))


@dataclass(frozen=True)
class Done(Generic[Result]):
    """What has been worked out, as a future gives it."""

    value: Result

    def result(self) -> Result:
        """The value."""
        return self.value

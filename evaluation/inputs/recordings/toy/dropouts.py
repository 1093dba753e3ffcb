"""Tracking with missing frames and pixels, and at a limited frame rate."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import FrameSet, Kind
from evaluation.inputs.recordings.toy.toy import RATE_HZ, Change, TrackedFrame

#: An estimate has recovered when its forward residual is at most this many times that of the undisturbed run.
RECOVERED = 1.25

#: First frame and number of frames of the gap in which nothing arrives.
GAP = (45, 30)


def changes(generator: np.random.Generator) -> Mapping[str, Change]:
    """Every kind of dropout by name, each in the depth image only but for the frames that are missing altogether."""
    return {
        "every third frame missing": lambda k, frames: None if k % 3 == 2 else frames,
        "two frames of three missing": lambda k, frames: frames if k % 3 == 0 else None,
        "30 % of the pixels missing": lambda k, frames: frames if k == 0 else _scattered(frames, generator),
        "five blocks of 24 × 24 pixels missing": lambda k, frames: frames if k == 0 else _blocks(frames, generator),
        "one second missing": lambda k, frames: None if GAP[0] <= k < sum(GAP) else frames,
    }


def _scattered(frames: FrameSet, generator: np.random.Generator) -> FrameSet:
    return _without(frames, lambda shape: generator.random(shape) < 0.3)


def _blocks(frames: FrameSet, generator: np.random.Generator) -> FrameSet:
    """Blocks somewhere around the object, which is in the middle third of the image."""

    def drawn(shape: tuple[int, ...]) -> NDArray[np.bool_]:
        lost = np.zeros(shape, bool)
        for _ in range(5):
            row, column = generator.integers((shape[0] // 5, shape[1] // 6), (shape[0] * 7 // 10, shape[1] // 2))
            lost[row : row + 24, column : column + 24] = True
        return lost

    return _without(frames, drawn)


def _without(frames: FrameSet, drawn: Callable[[tuple[int, ...]], NDArray[np.bool_]]) -> FrameSet:
    changed = dict(frames.frames)
    for key, frame in changed.items():
        if frame.kind == Kind.DEPTH:
            lost = drawn(frame.data.shape)
            changed[key] = replace(frame, data=np.where(lost, frame.data.dtype.type(0), frame.data))
    return replace(frames, frames=changed)


def recovery(gapped: Sequence[TrackedFrame], whole: Sequence[TrackedFrame]) -> int:
    """Frames after the gap until the residual is again what it is without one; as many as there are if never."""
    baseline = {frame.index: frame.agreement.forward_mm for frame in whole}
    after = [frame for frame in gapped if frame.index >= sum(GAP)]
    for count, frame in enumerate(after):
        if frame.agreement.forward_mm <= RECOVERED * baseline[frame.index]:
            return count
    return len(after)


@dataclass(frozen=True)
class Pace:
    """A live run at the sensor's rate: frames that were not tracked, and ages of the estimates [ms].

    Attributes:
        missed: frames that a newer one overtook while the tracker was busy.
        age_ms: from a frame's arrival to its estimate, of all that were tracked.
    """

    missed: int
    age_ms: NDArray[np.float64]


def pace(solve_ms: Sequence[float]) -> Pace:
    """Missed frames and ages at the sensor's rate, given the time of each search; a frame waits until a newer one.

    The first is left out: it includes initial detection.
    """
    period = 1000 / RATE_HZ
    free, missed, ages = 0.0, 0, []
    for k, took in enumerate(solve_ms[1:]):
        begin = max(free, k * period)
        if begin >= (k + 1) * period:
            missed += 1
            continue
        free = begin + took
        ages.append(free - k * period)
    return Pace(missed, np.array(ages))

"""The loop over frame sets of everything that tracks without a bus: recordings, arrays, simulated sequences."""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracking.session import TrackingSession
from drivers.contract.frame import FrameSet


class TrackedSet(NamedTuple):
    """A frame set, its estimate, and the time from one to the other [ns], on the clock that was passed."""

    frames: FrameSet
    estimate: Estimate
    took_ns: int


def track_sets(
    session: TrackingSession, frame_sets: Iterable[FrameSet], clock: Callable[[], int], budget_ns: float = math.inf
) -> Iterator[TrackedSet]:
    """Tracks frame sets one after the other, when the next one is asked for; none is left out.

    Args:
        session: the session; in between, its model and mesh are those of the latest estimate.
        frame_sets: in order of time.
        clock: measures the searches [ns].
        budget_ns: time of a search [ns]; without a limit, nothing depends on the clock.

    Raises:
        ObservationError: a frame set does not fit the rig.
    """
    for frames in frame_sets:
        begin_ns = clock()
        estimate = session.track(frames, partial(_in_time, clock, begin_ns + budget_ns))
        yield TrackedSet(frames, estimate, clock() - begin_ns)


def _in_time(clock: Callable[[], int], deadline_ns: float) -> bool:
    return math.isinf(deadline_ns) or clock() < deadline_ns

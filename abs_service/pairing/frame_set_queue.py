"""Frame sets for a tracker, in order, or only the newest if it is slower than the cameras."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from statistics import median
from typing import Protocol

from abs_service.pairing.common_clock import CommonClock
from abs_service.pairing.synchroniser import Synchroniser
from drivers.contract.frame import Frame, FrameSet

#: Timeout of the wait for a frame [s]; bounds the reaction time to a stop request.
POLL_S = 0.05

#: Processing times in the running median: robust against a few slow frames, as after a stall.
DURATIONS = 9

#: Frame sets that wait for a tracker which keeps up; more would only add latency.
BACKLOG = 4


class FrameSource(Protocol):
    """Frames of several streams, such as `FrameSubscriber`.

    Attributes:
        last_error: error of the last malformed message; "" if there was none.
    """

    last_error: str

    @property
    def lost(self) -> Mapping[str, int]:
        """Frames that were published and did not arrive, by topic."""
        ...

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames that arrived and were dropped unseen, by topic."""
        ...

    @property
    def malformed(self) -> Mapping[str, int]:
        """Messages that are no frames, by topic."""
        ...

    def take(self, timeout_s: float) -> Frame | None:
        """The next frame; None if none comes within the timeout [s]."""
        ...


class FrameSetQueue:
    """Queue of frame sets, with frame skipping if the tracker is slower than the cameras.

    A tracker that is faster than the cameras gets all of them, in order: the backlog after a stall of the machine is
    processed within a few frames. A slower one gets the newest, so that latency does not grow; the others are counted.

    Args:
        frames: where they come from, in the order of their arrival.
        common_clock: brings their times to one clock.
        synchroniser: makes sets of them.
        clock: CLOCK_MONOTONIC [ns].
    """

    def __init__(
        self, frames: FrameSource, common_clock: CommonClock, synchroniser: Synchroniser, clock: Callable[[], int]
    ):
        self.skipped = 0
        self._common_clock = common_clock
        self._frames = frames
        self._synchroniser = synchroniser
        self._clock = clock
        self._waiting: deque[FrameSet] = deque()
        self._durations_ns: deque[int] = deque(maxlen=DURATIONS)
        self._taken_ns: int | None = None  # when the set was taken that is being worked on

    @property
    def counters(self) -> Mapping[str, int]:
        """Counters of losses.

        `skipped` frame sets; by topic, frames that were published and `lost` on the bus, frames `dropped` unseen here
        and `malformed` messages; by stream and cause, frames that are in no set and so `unused`.
        """
        counters = {"skipped": self.skipped}
        counters |= {f"lost.{topic}": number for topic, number in self._frames.lost.items()}
        counters |= {f"dropped.{topic}": number for topic, number in self._frames.dropped.items()}
        counters |= {f"malformed.{topic}": number for topic, number in self._frames.malformed.items()}
        for unused in (self._synchroniser.counters, self._common_clock.counters):
            counters |= {f"unused.{stream}": number for stream, number in unused.items()}
        return counters

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames so far that are in no set, by sensor, whatever the cause."""
        total: Counter[str] = Counter()
        frames, unused = self._frames, (self._synchroniser.counters, self._common_clock.counters)
        for counts in (frames.lost, frames.dropped, frames.malformed, *unused):
            for name, number in counts.items():
                total[name.partition("/")[0]] += number
        return total

    @property
    def clock_doubt(self) -> str:
        """See `CommonClock.doubt` and `Synchroniser.doubt`."""
        return "; ".join(filter(None, (self._common_clock.doubt, self._synchroniser.doubt)))

    @property
    def last_error(self) -> str:
        """Error of the last malformed message; "" if there was none."""
        return self._frames.last_error

    def take(self) -> FrameSet | None:
        """The next set; None if there is none yet. The call ends the processing of the last one."""
        if self._taken_ns is not None:
            self._durations_ns.append(self._clock() - self._taken_ns)
        self._collect()
        allowed = BACKLOG if self._keeps_up() else 1
        while len(self._waiting) > allowed:
            self._waiting.popleft()
            self.skipped += 1
        self._taken_ns = self._clock() if self._waiting else None
        return self._waiting.popleft() if self._waiting else None

    def _collect(self) -> None:
        frame = self._frames.take(0 if self._waiting else POLL_S)
        while frame is not None:
            if (converted := self._common_clock.convert(frame)) is not None:
                self._waiting.extend(self._synchroniser.add(*converted))
            frame = self._frames.take(0)
        self._waiting.extend(self._synchroniser.poll(self._clock()))

    def _keeps_up(self) -> bool:
        """True if the median processing time is below the interval between the queued sets."""
        if len(self._waiting) < 2 or not self._durations_ns:
            return False
        interval_ns = (self._waiting[-1].stamp_ns - self._waiting[0].stamp_ns) / (len(self._waiting) - 1)
        return median(self._durations_ns) < interval_ns

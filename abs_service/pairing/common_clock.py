"""Times of frames of several hosts on one clock: that of the reference stream's host."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from statistics import median
from typing import Protocol

from abs_service.pairing.waiting_stream import Key
from drivers.contract.frame import Frame

#: Intervals of the reference stream in the running median, which a few lost frames do not change.
INTERVALS = 9


class ClockOffset(Protocol):
    """Offset of a clock, such as `abs_service.bus.clock_offsets.Offset`."""

    @property
    def ns(self) -> int:
        """Term to add to a time of that clock [ns]."""
        ...

    @property
    def error_ns(self) -> int:
        """Largest error of the offset [ns]."""
        ...


class CommonClock:
    """Converts frames of other hosts' clocks to the clock of the reference stream.

    The offset's largest error goes with each frame, so that pairing can allow for it. Beyond half the reference's frame
    period, the nearest frame may be that of another exposure: it is refused and counted.

    Args:
        reference: stream whose host has the common clock.
        tolerance_ns: of the synchroniser [ns].
        offset: offset of a host's clock to any one clock, None if it is not known yet; see `ClockOffsets.offset`.
    """

    def __init__(self, reference: Key, tolerance_ns: int, offset: Callable[[str], ClockOffset | None]) -> None:
        self._reference = reference
        self._tolerance_ns = tolerance_ns
        self._offset = offset
        self._host_clock: str | None = None
        self._latest_ns = 0
        self._intervals_ns: deque[int] = deque(maxlen=INTERVALS)
        self._refused: Counter[str] = Counter()
        self._doubts: dict[str, str] = {}

    @property
    def counters(self) -> Mapping[str, int]:
        """Refused frames, as `<sensor>/<stream>.uncertain_clock`."""
        return dict(self._refused)

    @property
    def doubt(self) -> str:
        """The reason for which the latest frames of some sensors are refused, and what to do; "" if none are."""
        return "; ".join(self._doubts.values())

    def convert(self, frame: Frame) -> tuple[Frame, int] | None:
        """The frame with times of the common clock, and a term to add to the tolerance [ns]; None if it is refused.

        The term is the largest error, unless the tolerance would reach beyond half the frame period.
        As long as an offset is unknown, the frame stays as it is.
        """
        if frame.key == self._reference:
            self._follow(frame)
        if self._host_clock is None or frame.host_clock == self._host_clock:
            self._doubts.pop(frame.sensor, None)
            return frame, 0
        here, there = self._offset(self._host_clock), self._offset(frame.host_clock)
        if here is None or there is None:
            return frame, 0
        error_ns = here.error_ns + there.error_ns
        half_ns = median(self._intervals_ns or (0,)) / 2
        if error_ns > half_ns or not self._intervals_ns:
            self._refuse(frame, error_ns)
            return None
        self._doubts.pop(frame.sensor, None)
        by_ns = there.ns - here.ns
        times = {"t_host_ns": frame.t_host_ns + by_ns, "t_arrival_ns": frame.t_arrival_ns + by_ns}
        return replace(frame, **times, host_clock=self._host_clock), self._growth_ns(error_ns, half_ns)

    def _growth_ns(self, error_ns: int, half_ns: float) -> int:
        # Beyond half the period, the synchroniser would take the first of two frames in reach.
        return max(0, min(error_ns, int(half_ns) - self._tolerance_ns))

    def _follow(self, frame: Frame) -> None:
        if frame.host_clock != self._host_clock:
            self._intervals_ns.clear()
        elif frame.t_host_ns > self._latest_ns:
            self._intervals_ns.append(frame.t_host_ns - self._latest_ns)
        self._host_clock, self._latest_ns = frame.host_clock, frame.t_host_ns

    def _refuse(self, frame: Frame, error_ns: int) -> None:
        self._refused[f"{frame.sensor}/{frame.stream}.uncertain_clock"] += 1
        if self._intervals_ns:
            self._doubts[frame.sensor] = (
                f"{frame.sensor}: the clock of its host is known to ± {error_ns * 1e-6:.1f} ms, more than half the "
                f"frame period of {median(self._intervals_ns) * 1e-6:.1f} ms, so its frames cannot be paired; "
                "use a network with a shorter round trip, a lower frame rate, or one host for all cameras"
            )

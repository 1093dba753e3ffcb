"""Groups frames of several streams by exposure time. Deterministic: no thread, no clock."""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

from abs_service.pairing.waiting_stream import Key, WaitingStream
from drivers.contract.frame import Frame, FrameSet

#: Queue length per stream.
DEPTH = 32
#: So many frames in a row with stamps in the future are no accident.
FUTURE_IN_A_ROW = 15
#: Latest frames of a stream that are judged, and number of stale ones among them that is reported.
LATEST, MANY = 30, 15


class Synchroniser:
    """Forms one `FrameSet` per frame of the reference stream.

    A set is formed as soon as every other stream has a frame within the tolerance; the nearest is taken. It is formed
    without the missing ones as soon as they cannot come any more: their stream is already past the tolerance, the
    deadline is over, or too many reference frames wait. Sets leave in order of time, no frame is in two of them, and
    within a stream later sets hold later frames.

    Frames are compared by the middle of their exposures (`Frame.at_middle`), on one host's clock. When the reference
    stream changes it, as after a reboot of that host, all streams begin anew. A stream's size and encoding are those of
    the first frame of its epoch, until many in a row have others.

    Args:
        reference: stream whose frames give the sets their time.
        members: all streams of a set; the reference may be among them.
        tolerance_ns: largest difference between a member's and the reference's `t_host_ns` [ns].
        deadline_ns: how long after its arrival in this process a reference frame waits for others, see `poll` [ns].
        offsets_ns: time offsets to add to `t_host_ns` of the frames of some sensors, by a calibration [ns].
    """

    def __init__(
        self,
        reference: Key,
        members: Iterable[Key],
        tolerance_ns: int,
        deadline_ns: int = 100_000_000,
        offsets_ns: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        self._reference = WaitingStream(reference)
        self._members = {key: WaitingStream(key) for key in members if key != reference}
        self._tolerance_ns = tolerance_ns
        self._deadline_ns = deadline_ns
        self._offsets_ns = offsets_ns
        self._host_clock: str | None = None
        self._seq = 0
        self._rejected: Counter[str] = Counter()
        self._in_future: Counter[Key] = Counter()  # in a row
        self._stale: defaultdict[Key, deque[bool]] = defaultdict(lambda: deque(maxlen=LATEST))

    @property
    def tolerance_ns(self) -> int:
        """Largest difference between a member's and the reference's times of one clock [ns]."""
        return self._tolerance_ns

    @property
    def counters(self) -> Mapping[str, int]:
        """Frames that are in no set, as `<sensor>/<stream>.<cause>`.

        Causes: `unexpected` stream, `other_clock` than the reference's, `old_epoch`, exposed in the `future` of its own
        arrival, `changed` size or encoding, `duplicate` exposure, `stale` (too late for its set), `unmatched` (no
        reference frame near it), `overflow` (too many wait for a reference frame).
        """
        return dict(self._rejected)

    @property
    def doubt(self) -> str:
        """Streams whose latest frames are all of the future, or often stale, and what to do; "" if there are none."""
        future = [
            f"{sensor}/{stream}: its time stamps are ahead of the arrival of its frames, so that none is used; start "
            "again what captures it"
            for (sensor, stream), number in self._in_future.items()
            if number >= FUTURE_IN_A_ROW
        ]
        stale = [
            f"{sensor}/{stream}: {sum(latest)} of its last {len(latest)} frames are not used, because their time "
            "stamps jump back or they come after their sets; start again what captures it"
            for (sensor, stream), latest in self._stale.items()
            if sum(latest) >= MANY
        ]
        return "; ".join(future + stale)

    def add(self, frame: Frame, error_ns: int = 0) -> list[FrameSet]:
        """Takes one frame and returns the sets that are decided now, in order of time.

        Args:
            frame: the frame.
            error_ns: of its times against the reference's clock, by which the tolerance grows [ns], see `CommonClock`.
        """
        if frame.key != self._reference.key and frame.key not in self._members:
            self._count(frame.key, "unexpected")
            return []
        if frame.t_host_ns > frame.t_arrival_ns + self._tolerance_ns:
            # If accepted, it would make every later frame of this stream stale.
            self._count(frame.key, "future")
            self._in_future[frame.key] += 1
            return []
        self._in_future[frame.key] = 0
        sets = self._follow_clock(frame)
        if frame.host_clock != self._host_clock:
            self._count(frame.key, "other_clock")
            return sets
        frame, offset_ns = frame.at_middle(), self._offsets_ns.get(frame.sensor, 0)
        self._insert(replace(frame, t_host_ns=frame.t_host_ns + offset_ns) if offset_ns else frame, error_ns)
        return sets + self._form()

    def group(self, frames: Iterable[Frame]) -> Iterator[FrameSet]:
        """All sets of a finished sequence, such as a recording."""
        for frame in frames:
            yield from self.add(frame)
        yield from self.flush()

    def poll(self, now_ns: int) -> list[FrameSet]:
        """Returns the sets whose deadline is over at `now_ns`, with the frames received so far.

        The time is that of this host's CLOCK_MONOTONIC, to which the frames' host times need not belong.
        A stream that was missing in a set is not waited for until it delivers again.
        """
        sets: list[FrameSet] = []
        while self._reference.waiting:
            is_over = _received_ns(self._reference.waiting[0]) + self._deadline_ns <= now_ns
            if not is_over and not all(stream.stalled for stream in self._incomplete_streams()):
                break
            sets.append(self._emit())
        return sets

    def flush(self) -> list[FrameSet]:
        """Returns all sets that still wait, with the frames received so far: the end of a recording."""
        return [self._emit() for _ in range(len(self._reference.waiting))]

    def _follow_clock(self, frame: Frame) -> list[FrameSet]:
        """Begins anew if a reference frame is of another clock; returns the sets that still waited."""
        if self._host_clock is None:
            self._host_clock = frame.host_clock
        if frame.host_clock == self._host_clock or frame.key != self._reference.key:
            return []
        sets = self.flush()
        for stream in self._members.values():
            for _ in range(len(stream.waiting)):
                self._drop_oldest(stream, "other_clock")
        self._reference = WaitingStream(self._reference.key)
        self._members = {key: WaitingStream(key) for key in self._members}
        self._host_clock = frame.host_clock
        return sets

    def _insert(self, frame: Frame, error_ns: int) -> None:
        stream = self._members.get(frame.key, self._reference)
        rejection_cause = stream.rejection_cause(frame)
        self._stale[frame.key].append(rejection_cause == "stale")
        if rejection_cause:
            self._count(frame.key, rejection_cause)
            return
        stream.insert(frame, error_ns)
        if stream is not self._reference and len(stream.waiting) > DEPTH:
            self._drop_oldest(stream, "overflow")

    def _form(self) -> list[FrameSet]:
        sets: list[FrameSet] = []
        while self._reference.waiting and (len(self._reference.waiting) > DEPTH or not self._incomplete_streams()):
            sets.append(self._emit())
        return sets

    def _incomplete_streams(self) -> list[WaitingStream]:
        """The streams for which the first waiting set has no frame, but may still get one."""
        t_ns = self._reference.waiting[0].t_host_ns
        return [
            stream
            for stream in self._members.values()
            if stream.latest_ns <= t_ns + self._tolerance_ns + stream.error_ns
            and stream.nearest(t_ns, self._tolerance_ns) is None
        ]

    def _emit(self) -> FrameSet:
        stalled = self._incomplete_streams()
        reference = self._reference.take_oldest()
        t_ns = reference.t_host_ns
        frames, missing, spread_ns = {reference.key: reference}, [], 0
        for stream in self._members.values():
            nearest = stream.nearest(t_ns, self._tolerance_ns)
            stream.stalled = stream in stalled
            # What lies before its frame, or before the reach of any later set, is of no use any more.
            obsolete_ns = t_ns - self._tolerance_ns - stream.error_ns if nearest is None else nearest.t_host_ns - 1
            while stream.waiting and stream.waiting[0].t_host_ns <= obsolete_ns:
                self._drop_oldest(stream, "unmatched")
            stream.passed_ns = max(stream.passed_ns, obsolete_ns)
            if nearest is None:
                missing.append(stream.key)
                continue
            frames[stream.key] = stream.take_oldest()
            spread_ns = max(spread_ns, abs(nearest.t_host_ns - t_ns))
        self._seq += 1
        return FrameSet(self._seq - 1, t_ns, frames, tuple(missing), spread_ns, reference.host_clock)

    def _drop_oldest(self, stream: WaitingStream, cause: str) -> None:
        stream.take_oldest()
        self._count(stream.key, cause)

    def _count(self, key: Key, cause: str) -> None:
        self._rejected[f"{key[0]}/{key[1]}.{cause}"] += 1


def _received_ns(frame: Frame) -> int:
    """Time at which the frame reached this process, on this host's clock [ns]."""
    return frame.t_arrival_ns if frame.t_received_ns is None else frame.t_received_ns

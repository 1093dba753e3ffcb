"""One stream of a synchroniser: its waiting frames, and which new ones it accepts."""

from bisect import insort
from collections import deque

from drivers.contract.frame import Frame

Key = tuple[str, str]

#: Sequence numbers remembered per stream, to detect duplicates.
MEMORY = 256

#: So many frames in a row that an earlier one excludes, by epoch, form, or more than this time [ns], are right.
FOREIGN, FOREIGN_NS = 30, 10_000_000_000

_NEVER_NS = -(1 << 63)


class WaitingStream:
    """Queued frames of one stream, by time, and the state of the stream.

    Attributes:
        waiting: the frames, by time.
        passed_ns: frames up to here are in a set or of no use [ns].
        latest_ns: of the frame that arrived last: the stream has come so far [ns].
        stalled: True if it made the last set wait in vain.
        error_ns: by which the tolerance grows, since its frames' times are another host's [ns].
    """

    def __init__(self, key: Key) -> None:
        self.key = key
        self.waiting: list[Frame] = []
        self.passed_ns = _NEVER_NS
        self.latest_ns = _NEVER_NS
        self.stalled = False
        self.error_ns = 0
        self._epoch = -1
        self._foreign = 0
        self._form: tuple[object, ...] = ()
        self._seen: deque[int] = deque(maxlen=MEMORY)

    def rejection_cause(self, frame: Frame) -> str:
        """Cause for which a frame is rejected; "" if it is accepted.

        One frame of a wrong epoch, size, encoding or time must not stop its stream: after `FOREIGN` others, it begins
        anew.
        """
        cause = self._cause(frame)
        is_foreign = cause in ("old_epoch", "changed") or (
            cause == "stale" and self.passed_ns - frame.t_host_ns > FOREIGN_NS
        )
        self._foreign = self._foreign + 1 if is_foreign else 0
        if self._foreign <= FOREIGN:
            return cause
        self.passed_ns, self._epoch, self._foreign = _NEVER_NS, -1, 0
        return ""

    def _cause(self, frame: Frame) -> str:
        if frame.epoch < self._epoch:
            return "old_epoch"
        if frame.epoch == self._epoch:
            if _form_of(frame) != self._form:
                return "changed"
            if frame.seq in self._seen:
                return "duplicate"
        if frame.t_host_ns <= self.passed_ns:
            return "stale"
        if any(frame.t_host_ns == other.t_host_ns for other in self.waiting):
            return "duplicate"
        return ""

    def insert(self, frame: Frame, error_ns: int) -> None:
        """Inserts an accepted frame; a new epoch resets the state of the stream."""
        self.error_ns = error_ns
        if frame.epoch > self._epoch:
            self._epoch = frame.epoch
            self._form = _form_of(frame)
            self._seen.clear()
        self._seen.append(frame.seq)
        self.latest_ns = frame.t_host_ns
        self.stalled = False
        insort(self.waiting, frame, key=lambda other: other.t_host_ns)

    def take_oldest(self) -> Frame:
        """Removes the first waiting frame; nothing before it is accepted from now on."""
        frame = self.waiting.pop(0)
        self.passed_ns = frame.t_host_ns
        return frame

    def nearest(self, t_ns: int, tolerance_ns: int) -> Frame | None:
        """The waiting frame nearest to a time, if it is within the tolerance and the error of its time."""
        frame = min(self.waiting, key=lambda other: abs(other.t_host_ns - t_ns), default=None)
        return frame if frame is not None and abs(frame.t_host_ns - t_ns) <= tolerance_ns + self.error_ns else None


def _form_of(frame: Frame) -> tuple[object, ...]:
    return frame.data.shape, frame.encoding, frame.geometry, frame.scale

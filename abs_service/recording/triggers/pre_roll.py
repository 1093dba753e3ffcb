"""The last seconds before a trigger, in memory."""

import threading
from collections import deque
from collections.abc import Callable

from abs_service.bus.contract import Sample
from abs_service.bus.health import Health, Level
from abs_service.bus.queues import BoundedQueue
from abs_service.recording.triggers.trigger import ALWAYS, Trigger


class PreRoll:
    """Passes messages to the recorder's queue while the trigger says so, and holds the last seconds otherwise.

    Args:
        queue: of the recorder.
        trigger: when to record.
        seconds: time for which a message is held [s].
        capacity: largest sum of the messages' sizes [bytes]; the oldest are dropped and counted.
        clock: monotonic time [ns].
        let_go: called with each message that is not held any longer, and not recorded.
    """

    def __init__(
        self,
        queue: BoundedQueue[Sample],
        trigger: Trigger,
        seconds: float,
        capacity: int,
        clock: Callable[[], int],
        let_go: Callable[[Sample], None],
    ) -> None:
        self._queue = queue
        self._trigger = trigger
        self._span_ns = int(seconds * 1e9)
        self._capacity = capacity
        self._clock = clock
        self._let_go = let_go
        self._held: deque[tuple[int, Sample]] = deque()
        self._size = 0
        self._lock = threading.Lock()
        self._dropped = self._reported = 0  # younger than `seconds`, for want of room; at the last report

    @property
    def is_open(self) -> bool:
        """True while messages are recorded."""
        return bool(self._trigger.reason)

    def put(self, sample: Sample) -> None:
        """Takes a message."""
        with self._lock:
            self._trigger.watch(sample)
            if self.is_open:
                self._release()
                self._queue.put(sample.topic, sample, sample.size)
            else:
                self._hold(sample)

    def ask(self, recording: bool) -> str:
        """Begins or ends recording; see `Trigger.ask`."""
        with self._lock:
            refusal = self._trigger.ask(recording)
            if self.is_open:
                self._release()
            return refusal

    def report(self, health: Health) -> None:
        """Tells why it is recorded, or how much is held, unless it is always recorded."""
        if self._trigger is ALWAYS:
            return
        with self._lock:
            held_s = (self._clock() - self._held[0][0]) * 1e-9 if self._held else 0.0
            size, dropped = self._size, self._dropped
        health.count_up_to({"pre_roll_dropped": dropped})
        health.gauge("pre_roll_bytes", size)
        health.label("trigger", self._trigger.reason or f"waits, and holds the last {held_s:.0f} s")
        is_short = dropped > self._reported
        message = f"record.pre_roll_bytes holds {held_s:.1f} s, not record.pre_roll_s" if is_short else ""
        health.report("pre_roll", Level.WARNING if message else Level.OK, message)
        self._reported = dropped

    def _release(self) -> None:
        while self._held:
            _, sample = self._held.popleft()
            self._queue.put(sample.topic, sample, sample.size)
        self._size = 0

    def _hold(self, sample: Sample) -> None:
        now_ns = self._clock()
        self._held.append((now_ns, sample))
        self._size += sample.size
        while self._held:
            t_ns, oldest = self._held[0]
            is_young = now_ns - t_ns <= self._span_ns
            if is_young and self._size <= self._capacity:
                return
            self._dropped += is_young
            self._held.popleft()
            self._size -= oldest.size
            self._let_go(oldest)

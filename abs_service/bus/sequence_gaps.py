"""Counts messages that were published and never came, from the gaps in their sequence numbers.

What follows the last message that came is known from the health of its publisher, which says how many there were.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import NamedTuple

from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from google.protobuf.message import DecodeError

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.health import published
from drivers.encoding.message_check import MAX_GAP

#: Publishers of a topic that are followed: the most recent ones. Two hosts with cameras both publish `health/capture`.
PUBLISHERS = 4
#: A message that has not come so long after a health that counts it is lost [ns]: health may overtake images.
LATE_NS = 1_000_000_000
#: Totals that wait for that, at most; a rig of ten sensors and four trackers has about 30 a second.
_WAITING = 1000


class _Total(NamedTuple):
    """Number of the last message that a publisher says it has published, and when it said so [ns]."""

    topic: str
    publisher: str
    seq: int
    t_ns: int


class SequenceGaps:
    """Losses by topic. Messages of one publisher come in order; another one, or a restarted one, counts anew.

    Thread-safe.

    Args:
        clock: monotonic time [ns].
    """

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._clock = clock
        self._lost: Counter[str] = Counter()
        # By topic and publisher, the one received last at the end: its last number, and up to which all is counted.
        self._latest: dict[str, dict[str, tuple[int, int]]] = {}
        self._totals: deque[_Total] = deque(maxlen=_WAITING)
        self._lock = threading.Lock()

    @property
    def lost(self) -> Mapping[str, int]:
        """Messages that never came, by topic; those after the last one that came, a second after a health has them."""
        return self._lost_until(self._clock() - LATE_NS)

    def settle(self) -> None:
        """Counts what has not come yet: no message is on its way any more."""
        self._lost_until(self._clock())

    def add(self, topic: str, publisher: str, seq: int) -> int:
        """Takes the number of a message in the order of arrival; returns how many were lost just before it."""
        with self._lock:
            latest = self._latest.setdefault(topic, {})
            last, counted = latest.pop(publisher, (seq, seq))
            latest[publisher] = seq, counted if last < seq <= counted else seq
            if len(latest) > PUBLISHERS:
                del latest[next(iter(latest))]
            return self._count(topic, seq - max(last, counted) - 1)

    def add_image(self, sample: Sample) -> None:
        """Counts an image like `add`; its number is in the attachment."""
        with suppress(DecodeError):  # reported when it is decoded
            header = FrameInfo.FromString(sample.attachment).header
            self.add(sample.topic, header.boot_id, header.seq)

    def add_health(self, sample: Sample) -> None:
        """Takes from a health how many images or estimates its process has published."""
        with suppress(DecodeError):
            health, now_ns = Health.FromString(sample.payload), self._clock()
            tracker, estimates = health.component.removeprefix("track/"), health.counters["estimates"]
            totals = published(health.counters)
            totals |= dict.fromkeys((keys.state(tracker), keys.mesh(tracker), keys.theta(tracker)), estimates)
            for topic, number in totals.items():
                self._totals.append(_Total(topic, health.header.boot_id, number - 1, now_ns))

    def forget(self) -> None:
        """Takes the next message of each topic as the first."""
        with self._lock:
            self._latest.clear()

    def _lost_until(self, t_ns: int) -> Mapping[str, int]:
        """Losses by topic, with those that healths show which came until a time [ns]."""
        with self._lock:
            while self._totals and self._totals[0].t_ns <= t_ns:
                topic, publisher, seq, _ = self._totals.popleft()
                latest = self._latest.get(topic, {})
                last, counted = latest.get(publisher, (seq, seq))
                if self._count(topic, seq - max(last, counted)):
                    latest[publisher] = last, seq
            return dict(self._lost)

    def _count(self, topic: str, gap: int) -> int:
        """Counts a gap and returns it; 0 if it is none."""
        if not 0 < gap <= MAX_GAP:
            return 0
        self._lost[topic] += gap
        return gap

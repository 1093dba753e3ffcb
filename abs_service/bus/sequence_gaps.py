"""Counts messages that were published and never came, from the gaps in their sequence numbers."""

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress

from absmsg.v1.frame_info_pb2 import FrameInfo
from google.protobuf.message import DecodeError

from abs_service.bus.contract import Sample
from drivers.encoding.message_check import MAX_GAP

#: Publishers of a topic that are followed: the most recent ones. Two hosts with cameras both publish `health/capture`.
PUBLISHERS = 4


class SequenceGaps:
    """Losses by topic. Messages of one publisher come in order; another one, or a restarted one, counts anew."""

    def __init__(self) -> None:
        self._lost: Counter[str] = Counter()
        self._latest: dict[str, dict[str, int]] = {}  # by topic and publisher, the one received last at the end

    @property
    def lost(self) -> Mapping[str, int]:
        """Messages that never came, by topic. Those after the last one that came are unknown."""
        return dict(self._lost)

    def add(self, topic: str, publisher: str, seq: int) -> int:
        """Takes the number of a message in the order of arrival; returns how many were lost just before it."""
        latest = self._latest.setdefault(topic, {})
        gap = seq - latest.pop(publisher, seq) - 1
        latest[publisher] = seq
        if len(latest) > PUBLISHERS:
            del latest[next(iter(latest))]
        if not 0 < gap <= MAX_GAP:
            return 0
        self._lost[topic] += gap
        return gap

    def add_image(self, sample: Sample) -> None:
        """Counts an image like `add`; its number is in the attachment."""
        with suppress(DecodeError):  # reported when it is decoded
            header = FrameInfo.FromString(sample.attachment).header
            self.add(sample.topic, header.boot_id, header.seq)

    def forget(self) -> None:
        """Takes the next message of each topic as the first."""
        self._latest.clear()

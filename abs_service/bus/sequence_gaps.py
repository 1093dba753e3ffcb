"""Counts messages that were published and never came, from the gaps in their sequence numbers."""

from collections import Counter
from collections.abc import Mapping

from absmsg.v1.common_pb2 import Header

from drivers.encoding.message_check import LARGEST_GAP


class SequenceGaps:
    """Losses by topic. Messages of one publisher come in order; another one, or a restarted one, counts anew."""

    def __init__(self) -> None:
        self._lost: Counter[str] = Counter()
        self._latest: dict[str, tuple[str, int]] = {}

    @property
    def lost(self) -> Mapping[str, int]:
        """Messages that never came, by topic. Those after the last one that came are unknown."""
        return dict(self._lost)

    def add(self, topic: str, header: Header) -> None:
        """Takes the header of a message in the order of arrival."""
        publisher, latest = self._latest.get(topic, ("", 0))
        gap = header.seq - latest - 1
        if publisher == header.boot_id and 0 < gap <= LARGEST_GAP:
            self._lost[topic] += gap
        self._latest[topic] = header.boot_id, header.seq

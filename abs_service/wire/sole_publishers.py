"""Finds topics that several processes publish at once, as those of two rigs with the same name do."""

from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from contextlib import suppress

from abs_service.bus.contract import Bus, Sample
from abs_service.wire.message_header import MessageHeaderError, parse

#: Time without a message after which a second publisher is gone, of topics that are sent once a second [ns].
GONE_NS = 3_000_000_000
#: Publishers of a topic that are remembered: those that were restarted, and their rivals.
REMEMBERED = 8


class SolePublishers:
    """Watches topics of which only one process may be the publisher at a time.

    A process that is started again takes the place of its predecessor, which never publishes again; rivals take turns.
    """

    def __init__(self, bus: Bus, patterns: Iterable[str], clock: Callable[[], int]) -> None:
        self._clock = clock
        self._publishers: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=REMEMBERED))
        self._turns_ns: dict[str, int] = {}
        for pattern in patterns:
            bus.subscribe(pattern, self._take)

    @property
    def trouble(self) -> str:
        """The topics with several publishers, in words; "" if there are none."""
        now_ns = self._clock()
        rivals = sorted(topic for topic, turn_ns in self._turns_ns.copy().items() if now_ns - turn_ns < GONE_NS)
        if not rivals:
            return ""
        return f"several processes publish {', '.join(rivals)}: another rig has the same name, or one was started twice"

    def _take(self, sample: Sample) -> None:
        with suppress(MessageHeaderError):
            publisher = parse(sample).publisher
            before = self._publishers[sample.topic]
            if before and before[-1] == publisher:
                return
            if publisher in before:
                before.remove(publisher)
                self._turns_ns[sample.topic] = self._clock()
            before.append(publisher)

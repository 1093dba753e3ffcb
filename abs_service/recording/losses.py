"""Losses of a recorder, by cause: messages that never came, and those that its queue did not hold."""

from collections.abc import Callable, Mapping
from contextlib import suppress

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.health import Health, Level
from abs_service.bus.sequence_gaps import SequenceGaps
from abs_service.wire import message_header
from abs_service.wire.estimate_messages import COMPACT, MESH, STATE

#: Messages beside images that their publisher numbers one after the other.
NUMBERED = frozenset({STATE, MESH, COMPACT, message_header.HEALTH})
#: Reports, one a second, after which the disk is fast enough again.
CALM_REPORTS = 10


class Losses:
    """Counts and reports losses.

    Args:
        health: of the recorder.
        clock: monotonic time [ns].
    """

    def __init__(self, health: Health, clock: Callable[[], int]) -> None:
        self._health = health
        self._gaps = SequenceGaps(clock)
        self._lost = 0  # at the last report
        self._dropped = self._slow_drops = 0
        self._calm = CALM_REPORTS  # reports in a row without a drop

    def arrive(self, sample: Sample) -> None:
        """Takes each message in the order of arrival."""
        if keys.is_image(sample.topic):
            self._gaps.add_image(sample)
        elif sample.message in NUMBERED:
            with suppress(message_header.MessageHeaderError):  # counted when it is written
                about = message_header.parse(sample)
                self._gaps.add(sample.topic, about.publisher, about.seq)
        if sample.message == message_header.HEALTH:
            self._gaps.add_health(sample)

    def settle(self) -> None:
        """Counts what has not come yet: no message is on its way any more."""
        self._gaps.settle()

    def report(self, dropped: Mapping[str, int], failed: bool) -> None:
        """Reports what is new.

        Args:
            dropped: messages that the queue has dropped so far, by topic.
            failed: whether recording has failed, which explains drops.
        """
        self._health.count_up_to(dropped, "dropped.")
        self._health.count_up_to(self._gaps.lost, "lost.")
        before, self._lost = self._lost, sum(self._gaps.lost.values())
        new = self._lost - before
        message = f"{new} messages were lost on their way to the recorder" if new else ""
        self._health.report("losses", Level.WARNING if new else Level.OK, message)
        new, self._dropped = sum(dropped.values()) - self._dropped, sum(dropped.values())
        if failed:
            return
        self._slow_drops += new
        self._calm = 0 if new else self._calm + 1
        slow = self._calm < CALM_REPORTS
        message = f"the disk is too slow: {self._slow_drops} messages dropped" if slow else ""
        self._health.report("queue", Level.WARNING if slow else Level.OK, message)

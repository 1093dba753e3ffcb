"""Trackers of a rig that no longer publish."""

import math
from collections.abc import Callable, Iterable, Mapping

from abs_service.bus import keys
from abs_service.bus.health import Health, Level
from abs_service.tracking.monitors.silence_monitor import SilenceMonitor


class TrackerSilence:
    """One `SilenceMonitor` per tracker; before the first estimate, the tracker itself says why there is none.

    Args:
        trackers: their names.
        clock: CLOCK_MONOTONIC [ns].
    """

    def __init__(self, trackers: Iterable[str], clock: Callable[[], int]) -> None:
        self._clock = clock
        self._monitors: dict[str, SilenceMonitor] = {}
        self.follow(trackers)

    @property
    def found(self) -> Mapping[str, str]:
        """For how long there has been no estimate, in words, by each tracker of which that is too long."""
        return {tracker: one.found for tracker, one in self._monitors.items() if one.found}

    def follow(self, trackers: Iterable[str]) -> list[str]:
        """Watches the trackers of another configuration; returns those that it watches no longer."""
        before = self._monitors
        self._monitors = {name: before.get(name) or SilenceMonitor(self._clock, math.inf) for name in trackers}
        return [name for name in before if name not in self._monitors]

    def restart(self, tracker: str) -> None:
        """Waits for the first estimate of a tracker anew, if it is watched."""
        if tracker in self._monitors:
            self._monitors[tracker] = SilenceMonitor(self._clock, math.inf)

    def received(self, topic: str) -> None:
        """Notes a message, which may be an estimate."""
        tracker = topic.partition("/")[0]
        if tracker in self._monitors and topic == keys.state(tracker):
            self._monitors[tracker].add()

    def report(self, health: Health) -> None:
        """Reports each tracker as silent or not."""
        for tracker, monitor in self._monitors.items():
            silence = monitor.check()
            level = Level.ERROR if silence else Level.OK
            health.report(keys.state(tracker), level, silence and f"track/{tracker}: {silence}")

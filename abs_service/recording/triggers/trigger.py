"""Triggers of a recording: always, or from an event on until some time after it."""

import threading
from collections.abc import Callable
from typing import Protocol

from absmsg.v1.deformation_state_pb2 import DeformationState
from google.protobuf.message import DecodeError

from abs_service.bus.contract import Sample
from abs_service.wire.estimate_messages import STATE

_DOUBTFUL = (DeformationState.STATUS_DEGRADED, DeformationState.STATUS_LOST)


class Trigger(Protocol):
    """Decides whether to record; called from any thread."""

    @property
    def reason(self) -> str:
        """Reason for recording; "" while nothing is recorded."""
        ...

    def ask(self, recording: bool) -> str:
        """Begins or ends on a command; returns the reason for a refusal, "" if accepted."""
        ...

    def watch(self, sample: Sample) -> None:
        """Takes every message of the rig."""
        ...


class AlwaysTrigger:
    """Records always."""

    reason = "always"

    def ask(self, recording: bool) -> str:
        """Refusal, with its reason."""
        return 'record.when = "always": it records as long as it runs'

    def watch(self, sample: Sample) -> None:
        """Ignores the message: everything is recorded."""


ALWAYS = AlwaysTrigger()


class RequestTrigger:
    """Records from a command on until the next, and after an event for some time.

    Args:
        watches_status: whether a tracker that leaves TRACKING for DEGRADED or LOST is an event.
        post_roll_s: time for which it is recorded after the last event [s].
        clock: monotonic time [ns].
    """

    def __init__(self, watches_status: bool, post_roll_s: float, clock: Callable[[], int]) -> None:
        self._watches_status = watches_status
        self._post_roll_ns = int(post_roll_s * 1e9)
        self._clock = clock
        self._statuses: dict[str, int] = {}
        self._is_requested = False
        self._event, self._until_ns = "", 0
        self._lock = threading.Lock()

    @property
    def reason(self) -> str:
        """See `Trigger`."""
        with self._lock:
            if self._is_requested:
                return "asked for"
            return self._event if self._clock() < self._until_ns else ""

    def ask(self, recording: bool) -> str:
        """Accepts. A command to end also ends what an event began."""
        with self._lock:
            self._is_requested = recording
            if not recording:
                self._until_ns = 0
        return ""

    def resume(self) -> None:
        """Resumes the recording of a killed recorder: until a command ends it, or as after an event."""
        with self._lock:
            self._is_requested = not self._watches_status
            self._event, self._until_ns = "the recorder was interrupted", self._clock() + self._post_roll_ns

    def watch(self, sample: Sample) -> None:
        """Looks at the status of estimates."""
        if not self._watches_status or sample.message != STATE:
            return
        try:
            status = DeformationState.FromString(sample.payload).status
        except DecodeError:  # another program publishes below our keys, which the recorder counts
            return
        with self._lock:
            before = self._statuses.get(sample.topic)
            self._statuses[sample.topic] = status
            if before == DeformationState.STATUS_TRACKING and status in _DOUBTFUL:
                name = DeformationState.Status.Name(status).removeprefix("STATUS_")
                self._event = f"{sample.topic.partition('/')[0]} was {name}"
                self._until_ns = self._clock() + self._post_roll_ns

"""Notices when a rig's trackers begin to track."""

import threading
from collections.abc import Collection

from absmsg.v1.deformation_state_pb2 import DeformationState
from google.protobuf.message import DecodeError

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample


class FirstTracking:
    """Notices the first estimate with status TRACKING of any tracker.

    Attributes:
        seen: set when something is tracked, and from the beginning if nothing is to be.
    """

    def __init__(self, bus: Bus, trackers: Collection[str]) -> None:
        self.seen = threading.Event()
        if not trackers:
            self.seen.set()
        for name in trackers:
            bus.subscribe(keys.state(name), self._take)

    def _take(self, sample: Sample) -> None:
        if self.seen.is_set():
            return
        try:
            state = DeformationState.FromString(sample.payload)
        except DecodeError:  # another program publishes below our keys, which the recorder counts
            return
        if state.status == DeformationState.STATUS_TRACKING:
            self.seen.set()

"""A client of the rig that notes every estimate, every exposure of the reference and every health."""

import math
import time
from typing import Self

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.wire.checked_bus import CheckedBus
from drivers.contract.host_clock import host_clock
from evaluation.service.live.rig import REFERENCE, TRACKER
from evaluation.service.live.subscriber import connect

#: The images that are tracked.
DEPTH = keys.image(REFERENCE, "depth")


class Listener:
    """Subscribes until it is closed.

    Args:
        endpoint: of the rig; may begin to listen later.
        rig: its name.

    Attributes:
        states: estimates: arrival and exposure, CLOCK_MONOTONIC [ns], and whether the status is TRACKING.
        frames: depth images: arrival [ns], number of the exposure, epoch, stamp of the wall clock [ns].
        health: arrival [ns] and health of all components.
        last_image: the latest depth image as it was sent.
    """

    def __init__(self, endpoint: str, rig: str) -> None:
        self.states: list[tuple[int, int, bool]] = []
        self.frames: list[tuple[int, int, int, int]] = []
        self.health: list[tuple[int, Health]] = []
        self.last_image = Sample(DEPTH, "", b"")
        self._bus = CheckedBus(connect(endpoint, rig), time.monotonic_ns)  # some faults are messages
        self._bus.subscribe(keys.state(TRACKER), self._take_state)
        self._bus.subscribe(DEPTH, self._take_image)
        self._bus.subscribe(keys.health("**"), self._take_health)

    def latest(self, since_ns: int) -> dict[str, Health]:
        """Last health of each component that has arrived since a moment."""
        return {one.component: one for t_ns, one in list(self.health) if t_ns >= since_ns}

    def tracks(self, since_ns: int, count: int = 3) -> bool:
        """True if the last `count` estimates say TRACKING and were exposed after `since_ns`."""
        return sum(tracking and exposed > since_ns for _, exposed, tracking in self.states[-count:]) == count

    def close(self) -> None:
        """Unsubscribes."""
        self._bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take_state(self, sample: Sample) -> None:
        state = DeformationState.FromString(sample.payload)
        tracking = state.status == DeformationState.STATUS_TRACKING
        now_ns = time.monotonic_ns()
        there = state.header.host_clock != host_clock()
        # The cameras' host may have a clock of its own.
        age_ms = 0.0 if math.isnan(state.age_ms) else state.age_ms
        exposed_ns = now_ns - round(age_ms * 1e6) if there else state.header.t_host_ns
        self.states.append((now_ns, exposed_ns, tracking))

    def _take_image(self, sample: Sample) -> None:
        info = FrameInfo.FromString(sample.attachment)
        self.frames.append((time.monotonic_ns(), info.seq, info.epoch, info.header.stamp.ToNanoseconds()))
        self.last_image = sample

    def _take_health(self, sample: Sample) -> None:
        self.health.append((time.monotonic_ns(), Health.FromString(sample.payload)))

"""A subscriber of estimates, with their arrival times, and of the health of all components."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.session import BusError, SessionMode
from abs_service.bus.zenoh_bus import ZenohBus

#: Attempts to connect to the router, each with the timeout of the bus.
ATTEMPTS = 10


@dataclass(frozen=True, slots=True)
class ReceivedEstimate:
    """One estimate as it arrived.

    Attributes:
        t_ns: when, CLOCK_MONOTONIC [ns].
        exposed_ns: exposure of the frames that it was made from [ns].
        seq: number of the estimate.
        is_tracking: True if its status is TRACKING.
        age_ms: time from the exposure to the publication, from the message [ms].
        solve_ms: time of the tracker's computation [ms].
        skipped: frame sets passed over before it.
        sensors: number of the exposure of each sensor that was used.
    """

    t_ns: int
    exposed_ns: int
    seq: int
    is_tracking: bool
    age_ms: float
    solve_ms: float
    skipped: int
    sensors: dict[str, int]


class Subscriber:
    """Subscribes to the estimates of one tracker and to the health of all components.

    Args:
        endpoint: of the rig; may begin to listen later.
        rig: its name.
        tracker: whose estimates.

    Attributes:
        arrivals: the estimates, by arrival.
        health: messages by component, in order of arrival.

    Raises:
        BusError: no router was found at the endpoint.
    """

    def __init__(self, endpoint: str, rig: str, tracker: str) -> None:
        self.arrivals: list[ReceivedEstimate] = []
        self.health: dict[str, list[Health]] = {}
        self._bus = connect(endpoint, rig)
        self._bus.subscribe(keys.state(tracker), self._take_state)
        self._bus.subscribe(keys.health("**"), self._take_health)

    def close(self) -> None:
        """Unsubscribes."""
        self._bus.close()

    def __enter__(self) -> "Subscriber":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take_state(self, sample: Sample) -> None:
        t_ns = time.monotonic_ns()
        state = DeformationState.FromString(sample.payload)
        self.arrivals.append(
            ReceivedEstimate(
                t_ns,
                state.header.t_host_ns,
                state.header.seq,
                state.status == DeformationState.STATUS_TRACKING,
                state.age_ms,
                state.solve_ms,
                state.skipped,
                {sensor.sensor: sensor.seq for sensor in state.sensors if not sensor.missing},
            )
        )

    def _take_health(self, sample: Sample) -> None:
        health = Health.FromString(sample.payload)
        self.health.setdefault(health.component, []).append(health)


def counted(health: Iterable[Health], until_ns: int) -> Mapping[str, int]:
    """Counters of a component in its first health message after `until_ns` [CLOCK_MONOTONIC, ns], or in its last."""
    counters: dict[str, int] = {}
    for one in health:
        counters = dict(one.counters)
        if one.header.t_host_ns >= until_ns:
            break
    return counters


def connect(endpoint: str, rig: str) -> ZenohBus:
    """A client of a rig whose router may begin to listen later.

    Raises:
        BusError: no router was found at the endpoint.
    """
    for _ in range(ATTEMPTS - 1):
        try:
            return ZenohBus.open(rig, endpoint, SessionMode.CLIENT)
        except BusError:
            continue
    return ZenohBus.open(rig, endpoint, SessionMode.CLIENT)

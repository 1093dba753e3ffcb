"""A subscriber like any other: keeps when each estimate arrived, and what every component says of its health."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.session import BusError, Role
from abs_service.bus.zenoh_bus import ZenohBus

#: How often the router is looked for, each time for as long as the bus does by itself.
ATTEMPTS = 10


@dataclass(frozen=True, slots=True)
class Arrival:
    """One estimate as it arrived.

    Attributes:
        t_ns: when, CLOCK_MONOTONIC [ns].
        exposed_ns: exposure of the frames that it was made from [ns].
        seq: number of the estimate.
        is_tracking: whether its status is TRACKING.
        age_ms: time from the exposure to the publication, as the tracker says [ms].
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


class Listener:
    """Listens to the estimates of one tracker, and to the health of all components.

    Args:
        endpoint: of the rig; may begin to listen later.
        rig: its name.
        tracker: whose estimates.

    Attributes:
        arrivals: the estimates, by arrival.
        health: what each component said, by component and by arrival.

    Raises:
        BusError: nothing ever listened at the endpoint.
    """

    def __init__(self, endpoint: str, rig: str, tracker: str) -> None:
        self.arrivals: list[Arrival] = []
        self.health: dict[str, list[Health]] = {}
        self._bus = connect(endpoint, rig)
        self._bus.subscribe(keys.state(tracker), self._take_state)
        self._bus.subscribe(keys.health("**"), self._take_health)

    def close(self) -> None:
        """Hears nothing more."""
        self._bus.close()

    def __enter__(self) -> "Listener":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take_state(self, sample: Sample) -> None:
        t_ns = time.monotonic_ns()
        state = DeformationState.FromString(sample.payload)
        self.arrivals.append(
            Arrival(
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
    """What a component has counted up to its first word after `until_ns` [CLOCK_MONOTONIC, ns], or to its last."""
    counters: dict[str, int] = {}
    for one in health:
        counters = dict(one.counters)
        if one.header.t_host_ns >= until_ns:
            break
    return counters


def connect(endpoint: str, rig: str) -> ZenohBus:
    """A client of a rig whose router may begin to listen later.

    Raises:
        BusError: nothing ever listened at the endpoint.
    """
    for _ in range(ATTEMPTS - 1):
        try:
            return ZenohBus.open(rig, endpoint, Role.CLIENT)
        except BusError:
            continue
    return ZenohBus.open(rig, endpoint, Role.CLIENT)

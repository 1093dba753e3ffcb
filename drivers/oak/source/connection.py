"""Source of an OAK device's images: an attached device, or depthai playing a recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from drivers.contract.capabilities import ClockInfo, SyncRole
from drivers.contract.clock import Stamp
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceInfo
from drivers.oak.eeprom import Poses
from drivers.oak.images.messages import Queue
from drivers.oak.images.picture import Picture
from drivers.oak.roles import Role

#: The clock of a device; depthai gives its times in microseconds.
CLOCK = ClockInfo("oak", 1e9)


class HostTimes(Protocol):
    """Mapping of a stream's device times to host times, such as `drivers.contract.clock.DeviceClock`."""

    @property
    def gauges(self) -> Mapping[str, float]:
        """Quality of the mapping."""
        ...

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """Host time of an exposure at device time `ticks` [ns] that arrived at `t_arrival_ns`."""
        ...


def arrival(picture: Picture, arrival_ns: int) -> int:
    """Arrival time in this process; for recordings, whose own host times are in the past."""
    return arrival_ns


def synchronised(picture: Picture, arrival_ns: int) -> int:
    """Host time of the exposure as estimated by depthai, without the transfer delay."""
    return min(picture.host_ns, arrival_ns)


@dataclass(frozen=True, eq=False)
class Connection:
    """A running pipeline.

    Attributes:
        info: identity of the device.
        queues: image queues of all streams.
        poses: extrinsics of the cameras.
        rate_hz: exposures per second.
        close: stops the pipeline; called once.
        host_times: factory of clock mappings, called for every stream at every start.
        ended: reason if the end of a queue is a regular end, "" if it is a failure.
        filters: filters that the device applies, by stream.
        modulation: range profile of a stream's exposure at a host time [ns], "" if it has none; None while it changes.
        stamp: maps an image and its arrival [ns] to the host time paired with its device time [ns].
        controls: controls of the device.
        sync_roles: supported synchronisation roles.
        gauges: self-measurements of the device.
    """

    info: DeviceInfo
    queues: Mapping[Role, Queue]
    poses: Poses
    rate_hz: float
    close: Callable[[], None]
    host_times: Callable[[], HostTimes]
    ended: str = ""
    filters: Mapping[Role, tuple[str, ...]] = field(default_factory=dict)
    modulation: Callable[[Role, int], str | None] = lambda role, t_host_ns: ""
    stamp: Callable[[Picture, int], int] = arrival
    controls: Controls = field(default_factory=Controls)
    sync_roles: tuple[SyncRole, ...] = (SyncRole.FREE,)
    gauges: Callable[[], Mapping[str, float]] = dict

"""What stands behind an OAK device: the real thing, or depthai playing a recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from drivers.contract.capabilities import ClockInfo, SyncRole
from drivers.contract.clock import Stamp
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceInfo
from drivers.oak.eeprom import Poses
from drivers.oak.messages import Queue
from drivers.oak.picture import Picture
from drivers.oak.roles import Role

#: The clock of a device; depthai gives its times in microseconds.
CLOCK = ClockInfo("oak", 1e9)


class HostTimes(Protocol):
    """From a stream's device times to host times; `drivers.contract.clock.DeviceClock` is one."""

    @property
    def gauges(self) -> Mapping[str, float]:
        """How well it does."""
        ...

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """The host time of an exposure at device time `ticks` [ns] that came at `t_arrival_ns`."""
        ...


def arrival(picture: Picture, arrival_ns: int) -> int:
    """When an image came: when we had it. The host times in a recording are of another day."""
    return arrival_ns


def synchronised(picture: Picture, arrival_ns: int) -> int:
    """When an image came: depthai's own estimate of its exposure, which the way through the cable does not delay."""
    return min(picture.host_ns, arrival_ns)


@dataclass(frozen=True, eq=False)
class Connection:
    """A running pipeline.

    Attributes:
        info: who the device is.
        queues: images of every stream.
        poses: where the cameras are.
        rate_hz: exposures per second.
        close: ends it; called once.
        host_times: makes what maps a stream's clock, for every stream at every start.
        ended: what the end of a queue means: why it is no failure, or "" if it is one.
        filters: what the device does to a stream's images.
        stamp: from an image and when we had it [ns] to the host time that its device time is compared with [ns].
        controls: what can be set.
        sync_roles: parts in a group that the device can take.
        gauges: what the device measures of itself.
    """

    info: DeviceInfo
    queues: Mapping[Role, Queue]
    poses: Poses
    rate_hz: float
    close: Callable[[], None]
    host_times: Callable[[], HostTimes]
    ended: str = ""
    filters: Mapping[Role, tuple[str, ...]] = field(default_factory=dict)
    stamp: Callable[[Picture, int], int] = arrival
    controls: Controls = field(default_factory=Controls)
    sync_roles: tuple[SyncRole, ...] = (SyncRole.FREE,)
    gauges: Callable[[], Mapping[str, float]] = dict

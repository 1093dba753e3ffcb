"""Capabilities of a device as plain data: streams, clocks, controls and synchronisation roles."""

from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.controls import ControlInfo
from drivers.contract.frame import Kind


class SyncRole(StrEnum):
    """Role of a device in a group whose exposures are triggered by wire or network."""

    FREE = "free"
    MASTER = "master"
    SLAVE = "slave"


@dataclass(frozen=True, slots=True)
class ClockInfo:
    """The clock that timestamps a stream. Clocks of one device's streams may drift apart.

    Attributes:
        domain: its name; timestamps are comparable within a domain. "host" is CLOCK_MONOTONIC itself.
        tick_hz: its rate, 0 if it has no ticks of its own.
        bits: width of its counter, which wraps at 2 ** bits ticks; 0 if it never wraps.
    """

    domain: str = "host"
    tick_hz: float = 0.0
    bits: int = 0


#: The clock of streams that are timestamped by the host.
HOST_CLOCK = ClockInfo()


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """One stream a device offers.

    Attributes:
        sensor, stream: its sensor (optical head) and name.
        kind, encoding, width, height: of its images [px].
        rate_hz: images per second.
        clock: of their timestamps.
        noisy: True if no two of its images are equal, because of the sensor's noise; False if they may be, as in a
            simulation without noise.
    """

    sensor: str
    stream: str
    kind: Kind
    encoding: str
    width: int
    height: int
    rate_hz: float
    clock: ClockInfo = HOST_CLOCK
    noisy: bool = True

    @property
    def key(self) -> tuple[str, str]:
        """(sensor, stream), as in `drivers.contract.frame.Frame.key`."""
        return self.sensor, self.stream


@dataclass(frozen=True, slots=True)
class Capabilities:
    """Capabilities of a device in the mode in which it was opened; constant until it is closed.

    Attributes:
        streams: the streams that it delivers.
        controls: parameters that can be set while it is open.
        sync_roles: supported synchronisation roles; the active one is the control `sync_role`.
        regular: True if its streams are periodic, so that silence is a fault; False for a recording.
    """

    streams: tuple[StreamInfo, ...]
    controls: tuple[ControlInfo, ...] = ()
    sync_roles: tuple[SyncRole, ...] = (SyncRole.FREE,)
    regular: bool = True

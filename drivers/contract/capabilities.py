"""What a device can do, as plain data: its streams, their clocks, what can be set, how it can be synchronised."""

from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.controls import ControlInfo
from drivers.contract.frame import Kind


class SyncRole(StrEnum):
    """What part a device can take in a group whose exposures are triggered by wire or network."""

    FREE = "free"
    MASTER = "master"
    SLAVE = "slave"


@dataclass(frozen=True, slots=True)
class ClockInfo:
    """The clock that stamps a stream. Streams of one device may have clocks that drift apart.

    Attributes:
        domain: its name; stamps of equal domains may be compared. "host" is CLOCK_MONOTONIC itself.
        tick_hz: its rate, 0 if it has no ticks of its own.
        bits: width of its counter, which begins anew at 2 ** bits ticks; 0 if it never does.
    """

    domain: str = "host"
    tick_hz: float = 0.0
    bits: int = 0


#: The clock of streams that the host stamps.
HOST_CLOCK = ClockInfo()


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """One stream a device offers: its sensor (optical head), name, kind, encoding, size [px], rate [Hz] and clock."""

    sensor: str
    stream: str
    kind: Kind
    encoding: str
    width: int
    height: int
    rate_hz: float
    clock: ClockInfo = HOST_CLOCK

    @property
    def key(self) -> tuple[str, str]:
        """(sensor, stream), as in `drivers.contract.frame.Frame.key`."""
        return self.sensor, self.stream


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a device can do in the mode in which it was opened; does not change until it is closed.

    Attributes:
        streams: what it delivers.
        controls: what can be set while it is open.
        sync_roles: parts that it can take among other devices; the one it takes is its control `sync_role`.
        regular: whether its streams keep coming at their rates, so that silence is a fault; not so in a recording.
    """

    streams: tuple[StreamInfo, ...]
    controls: tuple[ControlInfo, ...] = ()
    sync_roles: tuple[SyncRole, ...] = (SyncRole.FREE,)
    regular: bool = True

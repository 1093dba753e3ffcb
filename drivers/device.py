"""The contract between the service and every device."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.frame import Frame, Kind


class DeviceError(Exception):
    """A device cannot be opened or stopped working; the message says what to do about it."""


class AddressError(DeviceError):
    """An address that no device can have, now or later; opening it again is of no use."""


class DeviceState(StrEnum):
    """Where a device is in its life."""

    CLOSED = "closed"
    OPENING = "opening"
    STREAMING = "streaming"
    STALLED = "stalled"
    RECONNECTING = "reconnecting"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """One stream a device offers: its sensor (optical head), name, kind, encoding, size [px] and rate [Hz]."""

    sensor: str
    stream: str
    kind: Kind
    encoding: str
    width: int
    height: int
    rate_hz: float


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Who a device is: URI that opens it, model, serial number and firmware."""

    uri: str
    model: str
    serial: str
    firmware: str = ""


@dataclass(frozen=True, slots=True)
class Truth:
    """What a simulated device knows: where a grid of a surface's material points is at the moment of an exposure.

    Attributes:
        seq: exposure the truth belongs to.
        t_host_ns: its time, CLOCK_MONOTONIC [ns].
        points_r: (rows, columns, 3) rig coordinates [m]; entry (i, j) is the same material point in every frame.
        surface: which of the device's surfaces, counted from 0; each has a truth of its own.
    """

    seq: int
    t_host_ns: int
    points_r: NDArray[np.float32]
    surface: int = 0


class Sink(Protocol):
    """Where a device delivers to. No method blocks or raises; a device may call them from any thread of its own."""

    def on_frame(self, frame: Frame) -> None:
        """Takes one frame."""
        ...

    def on_truth(self, truth: Truth) -> None:
        """Takes what a simulated device knows about the exposure."""
        ...

    def on_state(self, state: DeviceState, reason: str) -> None:
        """Learns that the device changed its state, and why in plain words."""
        ...


class Device(Protocol):
    """A source of frames. `close` may be called at any time and any number of times."""

    @property
    def info(self) -> DeviceInfo:
        """Who the device is."""
        ...

    @property
    def streams(self) -> tuple[StreamInfo, ...]:
        """What it delivers."""
        ...

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Factory calibration of every sensor of the device, by sensor name."""
        ...

    @property
    def counters(self) -> Mapping[str, int]:
        """Frames delivered and dropped, by cause."""
        ...

    def start(self, sink: Sink) -> None:
        """Begins to deliver to `sink` from a thread of the device's own.

        Raises:
            DeviceError: the device cannot stream.
        """
        ...

    def stop(self) -> None:
        """Ends delivery; after it returns the sink is not called again."""
        ...

    def close(self) -> None:
        """Releases the device."""
        ...

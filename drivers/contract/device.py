"""The contract between the service and every device.

A driver is a module or package of `drivers`, named like the scheme of its addresses, with two functions:

- `open_device(uri: str, clock: Callable[[], int]) -> Device`: `clock` is CLOCK_MONOTONIC [ns]; what has to be chosen
  before opening (sizes, rates, mode) stands in the query of the address. `scheme://` alone is the only device attached.
- `discover(timeout_s: float) -> list[Found]`, see `drivers.contract.discovery`.

A driver opens, delivers, and says when it cannot go on. The device supervisor (`abs_service.capture.device_supervisor`)
notices silence and opens it again. No driver reconnects by itself. docs/devices.md says the same at more length.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities
from drivers.contract.controls import Controls
from drivers.contract.errors import AddressError, ControlError, DeviceError, FinalError, SdkMissingError
from drivers.contract.frame import Frame

__all__ = [
    "AddressError",
    "ControlError",
    "Device",
    "DeviceError",
    "DeviceInfo",
    "DeviceState",
    "FinalError",
    "SdkMissingError",
    "Sink",
    "Truth",
]


class DeviceState(StrEnum):
    """Where a device is in its life. Drivers report CLOSED, OPENING, STREAMING and FAILED; their keeper the others."""

    CLOSED = "closed"
    OPENING = "opening"
    STREAMING = "streaming"
    STALLED = "stalled"
    RECONNECTING = "reconnecting"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Who a device is.

    Attributes:
        uri: address that opens this very device again, by its serial number, on whatever port it is then.
        model: what it is called.
        serial: its serial number, "" if it cannot be read.
        firmware: its version, "" if unknown.
        link: how it is attached and how fast, "USB 3, 5 Gbit/s", say; "" if unknown.
    """

    uri: str
    model: str
    serial: str
    firmware: str = ""
    link: str = ""


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

    def on_warning(self, condition: str, message: str) -> None:
        """Learns that something needs attention though the device streams; `message` "" says that it is over.

        Args:
            condition: name of what is watched: "usb speed", "temperature".
            message: what is wrong and what to do about it, in plain words.
        """
        ...


class Device(Protocol):
    """A source of frames, opened. All methods may be called from any thread.

    Driver threads never wait for anyone: a frame that cannot be delivered is dropped and counted by its cause. What is
    incomplete or of the wrong size is never delivered.
    """

    @property
    def info(self) -> DeviceInfo:
        """Who the device is."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """What it delivers and what can be set."""
        ...

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Factory calibration of every sensor of the device, by sensor name."""
        ...

    @property
    def controls(self) -> Controls:
        """What can be set, from opening to closing."""
        ...

    @property
    def state(self) -> DeviceState:
        """Where the device is in its life: CLOSED before `start` and after `stop`."""
        ...

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, and frames dropped by cause; they only grow while the device is open."""
        ...

    @property
    def gauges(self) -> Mapping[str, float]:
        """What it measures of itself; names end in their unit: `temperature_c`, `clock.tof/depth.drift_ppm`."""
        ...

    def start(self, sink: Sink) -> None:
        """Begins to deliver to `sink` from a thread of the device's own, in a new epoch. Nothing if it is running.

        Raises:
            DeviceError: the device cannot stream, or was closed.
        """
        ...

    def stop(self) -> None:
        """Ends delivery; after it returns the sink is not called again. May be called at any time, and by the sink."""
        ...

    def close(self) -> None:
        """Stops and releases the device, also while another thread reads or starts it; any number of times."""
        ...

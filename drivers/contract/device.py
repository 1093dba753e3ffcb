"""The contract between the service and every device.

A driver is a module or package of `drivers`, named after the scheme of its addresses, with three functions:

- `open_device(uri: str, clock: Callable[[], int]) -> Device`: `clock` is CLOCK_MONOTONIC [ns]; settings that must be
  chosen before opening (sizes, rates, mode) are in the query of the address. `scheme://` opens the only attached one.
- `check_address(uri: str) -> None`: AddressError if no device can have the address; opens nothing.
- `discover(timeout_s: float) -> list[Found]`, see `drivers.contract.discovery`.

A driver opens a device, delivers frames and reports failure. It never reconnects: the device supervisor
(`abs_service.capture.device_supervisor`) detects stalls and reopens the device. See docs/how-to/devices.md.
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
    """Life cycle state. The device supervisor alone reports STALLED and RECONNECTING.

    After FAILED, opening the device again may help; after BROKEN, nothing does, as with a damaged recording.
    """

    CLOSED = "closed"
    OPENING = "opening"
    STREAMING = "streaming"
    STALLED = "stalled"
    RECONNECTING = "reconnecting"
    FAILED = "failed"
    BROKEN = "broken"

    @property
    def is_over(self) -> bool:
        """True if nothing is delivered until the next start."""
        return self in (DeviceState.CLOSED, DeviceState.FAILED, DeviceState.BROKEN)


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Identity of a device.

    Attributes:
        uri: address that reopens this device by its serial number, independent of the port.
        model: product name.
        serial: its serial number, "" if it cannot be read.
        firmware: its version, "" if unknown.
        link: connection and its speed, such as "USB 3, 5 Gbit/s"; "" if unknown.
    """

    uri: str
    model: str
    serial: str
    firmware: str = ""
    link: str = ""


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth of a simulated device: positions of a grid of material points at the time of an exposure.

    Attributes:
        seq: sequence number of the exposure.
        t_host_ns: its time, CLOCK_MONOTONIC [ns].
        points_r: (rows, columns, 3) rig coordinates [m]; entry (i, j) is the same material point in every frame.
        surface: index of the surface, from 0; each surface has its own truth.
    """

    seq: int
    t_host_ns: int
    points_r: NDArray[np.float32]
    surface: int = 0


class Sink(Protocol):
    """Receiver of a device's callbacks. No method blocks or raises; a device may call them from any of its threads.

    A class that inherits from it ignores what it does not override.
    """

    def on_frame(self, frame: Frame) -> None:
        """Called with each frame."""
        return

    def on_truth(self, truth: Truth) -> None:
        """Called with the ground truth of each exposure of a simulated device."""
        return

    def on_state(self, state: DeviceState, reason: str) -> None:
        """Called on each change of state, with the reason in plain words."""
        return

    def on_warning(self, condition: str, message: str) -> None:
        """Called when a condition needs attention while the device streams; an empty `message` clears it.

        Args:
            condition: name of the condition: "usb speed", "temperature".
            message: the problem and its remedy, in plain words.
        """
        return


class Device(Protocol):
    """A source of frames, opened. All methods may be called from any thread.

    Driver threads never block: a frame that cannot be delivered is dropped and counted by cause. Frames of the wrong
    size are never delivered, nor are incomplete ones, unless all that they lack is marked as no return.
    """

    @property
    def info(self) -> DeviceInfo:
        """Identity of the device."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """Streams and controls."""
        ...

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Factory calibration of every sensor of the device, by sensor name."""
        ...

    @property
    def controls(self) -> Controls:
        """Controls, usable from opening to closing."""
        ...

    @property
    def state(self) -> DeviceState:
        """Life cycle state: CLOSED before `start` and after `stop`."""
        ...

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, and frames dropped by cause; monotonic while the device is open."""
        ...

    @property
    def gauges(self) -> Mapping[str, float]:
        """Self-measurements; names end in their unit: `temperature_c`, `clock.tof/depth.drift_ppm`."""
        ...

    def start(self, sink: Sink) -> None:
        """Starts delivery to `sink` from the device's own threads, in a new epoch; no effect while it is running.

        Raises:
            DeviceError: the device cannot stream, or was closed.
        """
        ...

    def stop(self) -> None:
        """Stops delivery; the sink is not called after it returns. May be called at any time, also from the sink."""
        ...

    def close(self) -> None:
        """Stops and releases the device, also while another thread reads or starts it; idempotent."""
        ...

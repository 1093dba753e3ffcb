"""One camera on USB: detaching the kernel driver, opening, control transfers and streams."""

import errno
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import usb.core
import usb.util

from drivers.contract.device import DeviceError
from drivers.contract.discovery import UDEV_REMEDY
from drivers.kinect1 import usb_numbers
from drivers.kinect1.transport.transfer import DisconnectedError, Reader

#: Factory of readers of a device's streams.
ReaderFactory = Callable[[usb.core.Device, Sequence[int], Callable[[], int]], Reader]

_OUT, _IN = 0x40, 0xC0
_CONTROL_MS = 1000
_INTERFACE = 0

#: Endpoints of the streams; they select the alternate setting of the interface.
_PIPES = frozenset({0x81, 0x82})


class Port:
    """An opened camera.

    Args:
        device: the pyusb device.
        backend: its backend; must outlive it.
        streaming: factory of readers of its streams.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: it cannot be opened; names the remedy.
    """

    def __init__(
        self, device: usb.core.Device, backend: object, streaming: ReaderFactory, clock: Callable[[], int]
    ) -> None:
        self._device = device
        self._backend = backend
        self._streaming = streaming
        self._clock = clock
        self._lock = threading.Lock()
        self._readers = 0
        self._closing = False
        try:
            self._claim()
        except DeviceError:
            usb.util.dispose_resources(device)
            raise

    def write(self, data: bytes) -> None:
        """See `drivers.kinect1.transport.commands.Control`."""
        with self._opened(), translated_errors():
            self._device.ctrl_transfer(_OUT, 0, 0, 0, data, _CONTROL_MS)

    def read(self, size: int) -> bytes:
        """See `drivers.kinect1.transport.commands.Control`."""
        with self._opened(), translated_errors():
            return bytes(self._device.ctrl_transfer(_IN, 0, 0, 0, size, _CONTROL_MS))

    @contextmanager
    def reading(self, endpoints: Sequence[int]) -> Iterator[Reader]:
        """A reader of isochronous endpoints.

        Raises:
            DeviceError: insufficient USB bandwidth, or the port was closed.
        """
        with self._opened():
            self._refuse_if(self._closing)
            reader = self._streaming(self._device, endpoints, self._clock)
            self._readers += 1
        try:
            yield reader
        finally:
            reader.close()
            with self._lock:
                self._readers -= 1
                self._dispose()

    def close(self) -> None:
        """Releases the camera after the last reader is closed; idempotent."""
        with self._lock:
            self._closing = True
            self._dispose()

    @contextmanager
    def _opened(self) -> Iterator[None]:
        with self._lock:
            self._refuse_if(self._closing and self._readers == 0)
            yield

    def _refuse_if(self, closed: bool) -> None:
        if closed:
            raise DeviceError("the camera was closed")

    def _dispose(self) -> None:
        if self._closing and self._readers == 0:
            usb.util.dispose_resources(self._device)

    def _claim(self) -> None:
        with translated_errors():
            self._detach_kernel()
            if not self._is_configured():
                self._device.set_configuration()
            usb.util.claim_interface(self._device, _INTERFACE)
            setting = self._setting()
            if setting > 0:
                self._device.set_interface_altsetting(_INTERFACE, setting)

    def _is_configured(self) -> bool:
        """True if the kernel has configured it; configuring again would reset it, which late models do not survive."""
        try:
            self._device.get_active_configuration()
        except usb.core.USBError as error:
            if error.errno is not None:
                raise
            return False
        return True

    def _detach_kernel(self) -> None:
        try:
            if self._device.is_kernel_driver_active(_INTERFACE):
                self._device.detach_kernel_driver(_INTERFACE)
        except NotImplementedError:
            return  # only on Linux a kernel driver holds the camera
        except usb.core.USBError as error:
            if error.errno in {errno.ENODEV, errno.EACCES}:
                raise
            raise DeviceError(
                f"the kernel's webcam driver holds the camera and does not let go ({error.strerror}):  "
                f"{usb_numbers.KERNEL_REMEDY}"
            ) from error

    def _setting(self) -> int:
        """The alternate setting with both endpoints and the largest packets."""
        fitting: list[tuple[int, int]] = []
        configuration: Any = self._device.get_active_configuration()
        for interface in configuration:
            pipes = {end.bEndpointAddress: end.wMaxPacketSize for end in interface}
            if interface.bInterfaceNumber == _INTERFACE and set(pipes) >= _PIPES:
                fitting.append((min(pipes[address] for address in _PIPES), interface.bAlternateSetting))
        if not fitting:
            raise DeviceError("the camera has no streams; plug it in again, and check its power supply")
        return max(fitting)[1]


@contextmanager
def translated_errors() -> Iterator[None]:
    """Translates pyusb's errors into `DeviceError`s that name the remedy."""
    try:
        yield
    except usb.core.USBError as error:
        raise translate(error) from error


def translate(error: usb.core.USBError) -> DeviceError:
    """The `DeviceError` of a pyusb error."""
    match error.errno:
        case errno.ENODEV | errno.ENOENT | errno.ESHUTDOWN:
            return DisconnectedError("the camera was unplugged")
        case errno.EACCES | errno.EPERM:
            return DeviceError(f"you may not open the camera; {UDEV_REMEDY}")
        case errno.EBUSY:
            return DeviceError("another program uses the camera; end it")
        case errno.ETIMEDOUT:
            return DeviceError("the camera does not answer; check its power supply")
    return DeviceError(f"the camera does not work: {error}; plug it in again")

"""Fake USB: a pyusb backend and an isochronous reader for emulated cameras, without hardware or libusb."""

import array
import errno
import time
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import usb.backend
import usb.core

from drivers.kinect1.transport.transfer import MICROFRAME_NS, DisconnectedError, Transfer
from evaluation.service.kinect1_emulation import usb_descriptors
from evaluation.service.kinect1_emulation.emulated_camera import EmulatedKinect


class FakeDevice:
    """An attached USB device.

    Attributes:
        kinect: the camera; unused by an audio device.
        kernel_driver: True if a kernel driver holds it; a `stubborn` one cannot be detached.
        refusal: errno of opening it, 0 for success.
        now: current microframe.
        pace: playback speed; 1 is real time, `math.inf` as fast as it is read.
        damage: modifies packets and their lengths in transit, given the first microframe.
        opened, claims, readers: current numbers.
    """

    def __init__(self, kinect: EmulatedKinect, serial: str, product: int = 0x02AE, ports: tuple = (1, 1)) -> None:
        self.kinect = kinect
        self.serial = serial
        self.product = product
        self.ports = ports
        self.speed = 3
        self.plugged = True
        self.kernel_driver = self.stubborn = False
        self.refusal = 0
        self.claims = 0
        self.opened = 0
        self.settings: list[int] = []
        self.configuration = 1
        self.now = 0
        self.pace = 1.0
        self.readers = 0
        self.damage: Callable[[int, np.ndarray, np.ndarray], None] = lambda first, packets, lengths: None


#: Untyped, because pyusb declares that its methods return nothing.
_IBackend: Any = usb.backend.IBackend


class FakeBackend(_IBackend):
    """pyusb backend of some devices; `wide` adds an alternate setting, as the Kinect for Windows has."""

    def __init__(self, devices: Sequence[FakeDevice], wide: bool = False) -> None:
        super().__init__()
        self.devices = list(devices)
        self._interfaces = usb_descriptors.INTERFACES if wide else usb_descriptors.INTERFACES[-1:]

    def enumerate_devices(self) -> Iterator[FakeDevice]:
        return (device for device in self.devices if device.plugged)

    def get_parent(self, dev: FakeDevice) -> None:
        return None

    def get_device_descriptor(self, dev: FakeDevice) -> Any:
        fields = usb_descriptors.fields("device", usb_descriptors.device(dev.product))
        place = {"address": 2, "bus": 1, "port_number": dev.ports[-1], "port_numbers": dev.ports, "speed": dev.speed}
        return SimpleNamespace(**fields, **place)

    def get_configuration_descriptor(self, dev: FakeDevice, config: int) -> Any:
        if config > 0:
            raise IndexError
        fields = usb_descriptors.fields("configuration", usb_descriptors.configuration())
        return SimpleNamespace(**fields, extra_descriptors=[])

    def get_interface_descriptor(self, dev: FakeDevice, intf: int, alt: int, config: int) -> Any:
        if intf > 0 or alt >= len(self._interfaces):
            raise IndexError
        fields = usb_descriptors.fields("interface", usb_descriptors.interface(alt, len(self._interfaces[alt])))
        return SimpleNamespace(**fields, extra_descriptors=[])

    def get_endpoint_descriptor(self, dev: FakeDevice, ep: int, intf: int, alt: int, config: int) -> Any:
        endpoint = usb_descriptors.endpoint(*self._interfaces[alt][ep])
        fields = usb_descriptors.fields("endpoint", endpoint)
        return SimpleNamespace(**fields, bRefresh=0, bSynchAddress=0, extra_descriptors=[])

    def open_device(self, dev: FakeDevice) -> FakeDevice:
        self._check(dev)
        if dev.refusal:
            raise error(dev.refusal)
        dev.opened += 1
        return dev

    def close_device(self, dev_handle: FakeDevice) -> None:
        dev_handle.opened -= 1

    def get_configuration(self, dev_handle: FakeDevice) -> int:
        return dev_handle.configuration

    def set_configuration(self, dev_handle: FakeDevice, config_value: int) -> None:
        dev_handle.configuration = config_value

    def set_interface_altsetting(self, dev_handle: FakeDevice, intf: int, altsetting: int) -> None:
        dev_handle.settings.append(altsetting)

    def claim_interface(self, dev_handle: FakeDevice, intf: int) -> None:
        self._check(dev_handle)
        if dev_handle.kernel_driver or dev_handle.claims:
            raise error(errno.EBUSY)
        dev_handle.claims += 1

    def release_interface(self, dev_handle: FakeDevice, intf: int) -> None:
        dev_handle.claims -= 1

    def is_kernel_driver_active(self, dev_handle: FakeDevice, intf: int) -> bool:
        return dev_handle.kernel_driver

    def detach_kernel_driver(self, dev_handle: FakeDevice, intf: int) -> None:
        if dev_handle.stubborn:
            raise error(errno.EPERM)
        dev_handle.kernel_driver = False

    def ctrl_transfer(
        self,
        dev_handle: FakeDevice,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> int:
        self._check(dev_handle)
        match bmRequestType, bRequest:
            case 0x80, 6 if wValue >> 8 == 3:
                answer = usb_descriptors.string(dev_handle.serial)
            case 0x40, 0:
                dev_handle.kinect.request(bytes(data))
                return len(data)
            case 0xC0, 0:
                answer = dev_handle.kinect.answer(len(data))
            case _:
                raise error(errno.EPIPE)
        data[: len(answer)] = array.array("B", answer)
        return len(answer)

    def _check(self, device: FakeDevice) -> None:
        if not device.plugged:
            raise error(errno.ENODEV)


def error(number: int) -> usb.core.USBError:
    """The pyusb exception of an errno."""
    return usb.core.USBError(errno.errorcode[number], -1, number)


class FakeReader:
    """Isochronous reader of one device, paced by its microframes."""

    MICROFRAMES = 64

    def __init__(self, device: usb.core.Device, endpoints: Sequence[int], clock: Callable[[], int]) -> None:
        self._fake: FakeDevice = device._ctx.dev  # noqa: SLF001 - pyusb has no public way to it
        self._clock = clock
        self._endpoints = endpoints
        self._begin, self._begin_ns = self._fake.now, clock()
        self._fake.readers += 1

    def read(self, timeout_s: float) -> Iterator[Transfer]:
        fake, kinect = self._fake, self._fake.kinect
        passed_ns = (fake.now + self.MICROFRAMES - self._begin) * MICROFRAME_NS
        time.sleep(max(passed_ns / fake.pace - (self._clock() - self._begin_ns), 0) * 1e-9)
        for endpoint in self._endpoints:
            if not fake.plugged:
                raise DisconnectedError("the camera was unplugged")
            packets, lengths = kinect.microframes(endpoint, fake.now, self.MICROFRAMES)
            fake.damage(fake.now, packets, lengths)
            yield Transfer(endpoint, packets, lengths, self._begin_ns + passed_ns)
        fake.now += self.MICROFRAMES

    def close(self) -> None:
        self._fake.readers -= 1

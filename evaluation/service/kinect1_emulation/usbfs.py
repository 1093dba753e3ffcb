"""The kernel's side of USB devices (usbfs), for programs that run under umockdev.

umockdev's preloaded library sends every ioctl on a device's file to a socket; this answers them with an emulated camera
behind.
"""

import errno
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from evaluation.service.kinect1_emulation import usb_descriptors
from evaluation.service.kinect1_emulation.emulated_camera import EmulatedKinect
from evaluation.service.kinect1_emulation.packet_stream import MICROFRAMES_HZ, images_of
from evaluation.service.kinect1_emulation.umockdev import Program

# struct usbdevfs_urb, and struct usbdevfs_iso_packet_desc behind it: length, actual length, status.
_URB = struct.Struct("<BBxxiIxxxxQiiiiiIQ")
_STATUS, _ACTUAL, _PACKETS = 4, 28, 56
_CONTROL_URB, _ISOCHRONOUS_URB = 2, 0

#: The longest that a program is kept waiting which asks what is finished [s]: it asks again and again.
_WAIT_S = 0.005


def _code(direction: int, number: int, size: int) -> int:
    return direction << 30 | size << 16 | ord("U") << 8 | number


SUBMIT, DISCARD = _code(2, 10, 56), _code(0, 11, 0)
REAP, REAP_NOW = _code(1, 12, 8), _code(1, 13, 8)
SET_INTERFACE, SET_CONFIGURATION = _code(2, 4, 8), _code(2, 5, 4)
GET_DRIVER, INTERFACE_IOCTL, DISCONNECT = _code(1, 8, 260), _code(3, 18, 16), _code(0, 22, 0)
CLAIM, RELEASE = _code(2, 15, 4), _code(2, 16, 4)
CAPABILITIES, SPEED, CLEAR_HALT = _code(1, 26, 4), _code(0, 31, 0), _code(2, 21, 4)

#: Zero packets, bulk continuation, no limit of packet sizes, reaping after the end.
_CAPABLE = 0x17
_HIGH_SPEED = 3

#: The first microframe: when this process began.
BEGIN_S = time.monotonic()


@dataclass
class Socketed:
    """A device behind a socket.

    Attributes:
        kinect: what it is.
        serial: its serial number.
        driver: the kernel driver that holds it, "" if none does; a `stubborn` one does not let go.
        plugged: whether it is attached.
        disturbed: whether one packet of each transfer comes with an error of the host, its bytes all there.
        claimed: by how many programs.
        late: images by pipe and number that cannot have been received whole, because nobody took a packet of them.
    """

    kinect: EmulatedKinect
    serial: str
    driver: str = ""
    stubborn: bool = False
    plugged: bool = True
    disturbed: bool = False
    claimed: int = 0
    late: set[tuple[int, int]] = field(default_factory=set)


@dataclass
class _Urb:
    """A request under way: where it is in the program's memory, its buffer, its microframes."""

    address: int
    buffer: int
    first: int
    count: int


class Connection:
    """One open file of a device: serves ioctls until it is closed.

    Args:
        program: the one that has the file open.
        device: what the file is.
        patient: whether the device waits while nobody takes its packets, as no real one does. A test of what becomes of
            packets needs it on a machine that is too busy for real time.
    """

    def __init__(self, program: Program, device: Socketed, patient: bool) -> None:
        self._program = program
        self._device = device
        self._queues: dict[int, deque[_Urb]] = {0x81: deque(), 0x82: deque()}
        self._ends: dict[int, int] = {0x81: 0, 0x82: 0}
        self._finished: deque[int] = deque()
        self._claimed = False
        self._patient = patient
        self._handlers: Mapping[int, Callable[[int], int]] = {
            SUBMIT: self._submit,
            REAP: self._reap,
            REAP_NOW: self._reap,
            DISCARD: self._discard,
            CLAIM: self._claim,
            RELEASE: self._release,
            GET_DRIVER: self._driver,
            INTERFACE_IOCTL: self._disconnect,
            CAPABILITIES: self._capabilities,
            SPEED: lambda _: _HIGH_SPEED,
            **dict.fromkeys((SET_INTERFACE, SET_CONFIGURATION, CLEAR_HALT), lambda _: 0),
        }

    def serve(self) -> None:
        """Serves ioctls until the program closes the file."""
        for request, argument in self._program.ioctls():
            self._program.done(self._ioctl(request, argument))
        self._device.claimed -= self._claimed

    def _ioctl(self, request: int, argument: int) -> int:
        """Result of an ioctl, negative errno if it fails."""
        if not self._device.plugged and request not in {REAP, REAP_NOW, DISCARD}:
            return -errno.ENODEV
        return self._handlers.get(request, lambda _: -errno.ENOTTY)(argument)

    def _capabilities(self, argument: int) -> int:
        self._program.write(argument, struct.pack("<I", _CAPABLE))
        return 0

    def _driver(self, argument: int) -> int:
        self._program.write(argument + 4, self._device.driver.encode() + b"\0")
        return 0 if self._device.driver else -errno.ENODATA

    def _release(self, _: int) -> int:
        self._device.claimed -= self._claimed
        self._claimed = False
        return 0

    def _claim(self, _: int) -> int:
        if self._device.driver or (self._device.claimed and not self._claimed):
            return -errno.EBUSY
        self._device.claimed += not self._claimed
        self._claimed = True
        return 0

    def _disconnect(self, argument: int) -> int:
        _, code, _ = struct.unpack("<iiQ", self._program.read(argument, 16))
        if code != DISCONNECT:
            return -errno.ENOTTY
        if self._device.stubborn:
            return -errno.EPERM
        self._device.driver = ""
        return 0

    def _submit(self, address: int) -> int:
        kind, endpoint, _, _, buffer, _, _, _, count, *_ = _URB.unpack(self._program.read(address, _URB.size))
        if kind == _CONTROL_URB:
            status, size = self._control(buffer)
            self._finish(address, status, size)
            return 0
        if kind != _ISOCHRONOUS_URB or endpoint not in self._queues:
            return -errno.EINVAL
        end = self._ends[endpoint]
        first = end if self._patient and end else max(end, _now() + 1)
        if end:
            self._device.late |= {(endpoint, number) for number in images_of(end, first)}
        self._queues[endpoint].append(_Urb(address, buffer, first, count))
        self._ends[endpoint] = first + count
        return 0

    def _control(self, buffer: int) -> tuple[int, int]:
        """Status and length of a control transfer, whose data follow its eight bytes of setup."""
        kind, request, value, _, size = struct.unpack("<BBHHH", self._program.read(buffer, 8))
        match kind, request:
            case 0x40, 0:
                self._device.kinect.request(self._program.read(buffer + 8, size))
                return 0, size
            case 0xC0, 0:
                answer = self._device.kinect.answer(size)
            case 0x80, 6 if value >> 8 == 3:
                answer = usb_descriptors.string(self._device.serial)[:size]
            case _:
                return -errno.EPIPE, 0
        self._program.write(buffer + 8, answer)
        return 0, len(answer)

    def _reap(self, argument: int) -> int:
        if not self._finished:
            self._advance()
        if not self._finished:
            return -errno.EAGAIN if self._device.plugged else -errno.ENODEV
        self._program.write(argument, struct.pack("<Q", self._finished.popleft()))
        return 0

    def _advance(self) -> None:
        """Waits until a transfer is complete, but not long."""
        waiting = [(queue[0].first + queue[0].count, endpoint) for endpoint, queue in self._queues.items() if queue]
        end, endpoint = min(waiting, default=(_now() + 8, 0))
        time.sleep(min(max((end - _now()) / MICROFRAMES_HZ, 0), _WAIT_S))
        if not self._device.plugged:
            for queue in self._queues.values():
                while queue:
                    self._finish(queue.popleft().address, -errno.ESHUTDOWN, 0)
        elif endpoint and _now() >= end:
            self._carry(endpoint, self._queues[endpoint].popleft())

    def _carry(self, endpoint: int, urb: _Urb) -> None:
        packets, lengths = self._device.kinect.microframes(endpoint, urb.first, urb.count)
        results = np.zeros((urb.count, 3), "<u4")
        results[:, 0], results[:, 1] = packets.shape[1], lengths
        if self._device.disturbed:
            results[urb.first * 7 % 64 :: 64, 2] = 2**32 - errno.EPROTO
        self._program.write(urb.buffer, packets.tobytes())
        self._program.write(urb.address + _PACKETS, results.tobytes())
        self._finish(urb.address, 0, packets.size)

    def _discard(self, address: int) -> int:
        for queue in self._queues.values():
            for urb in queue:
                if urb.address == address:
                    queue.remove(urb)
                    self._finish(address, -errno.ENOENT, 0)
                    return 0
        return -errno.EINVAL

    def _finish(self, address: int, status: int, size: int) -> None:
        self._program.write(address + _STATUS, struct.pack("<i", status))
        self._program.write(address + _ACTUAL, struct.pack("<i", size))
        self._finished.append(address)


def _now() -> int:
    """The microframe under way."""
    return int((time.monotonic() - BEGIN_S) * MICROFRAMES_HZ)

"""The Kinect v1 on a fake USB."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from drivers.contract.device import Device
from evaluation.service.kinect1_emulation.bit_packing import pack
from evaluation.service.kinect1_emulation.emulated_camera import FORMS, EmulatedKinect, noise
from evaluation.service.kinect1_emulation.packet_stream import PacketStream, begin
from tests.drivers.conformance.bench import BEFORE, Fault

SERIALS = ("A00363A01234040A", "A00363A05678041A")

#: First microframe of a fault; the first image may have begun before the stream was started.
_AFTER = begin(BEFORE + 2)

#: Playback speed.
_PACE = 4.0


class KinectBench:
    def open(self, fault: Fault = Fault.NONE) -> Device:
        return self._open(SERIALS[0], fault)

    def open_second(self) -> Device:
        return self._open(SERIALS[1], Fault.NONE)

    def _open(self, serial: str, fault: Fault) -> Device:
        from drivers.kinect1.address import Address
        from drivers.kinect1.opening import open_camera
        from tests.drivers.kinect1.fake_usb import FakeBackend, FakeDevice, FakeReader

        fake = FakeDevice(_empty() if fault == Fault.NAN else noise(2), serial)
        fake.pace = _PACE

        def damage(first: int, packets: np.ndarray, lengths: np.ndarray) -> None:
            if first < _AFTER:
                return
            match fault:
                case Fault.DROP if first % 640 == 0:
                    lengths[0] = 0
                case Fault.STALL:
                    lengths[:] = 0
                case Fault.UNPLUG:
                    fake.plugged = False
                case Fault.WRONG_SIZE if first % 640 == 0:
                    lengths[:] = np.minimum(lengths, 500)

        fake.damage = damage
        backend = FakeBackend([fake])
        return open_camera(Address(serial), time.monotonic_ns, lambda: backend, FakeReader)


def _empty() -> EmulatedKinect:
    """A camera with some depth images without any return."""
    streams = noise(2).packet_streams
    nothing = pack(np.full((480, 640), 2047), 11)
    return EmulatedKinect({**streams, "depth": PacketStream(FORMS["depth"], [*streams["depth"].images, nothing])})


@contextmanager
def bench() -> Iterator[KinectBench]:
    yield KinectBench()

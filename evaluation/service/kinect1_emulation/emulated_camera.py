"""Emulated Kinect: command protocol and packet streams, independent of the USB transport."""

import struct
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from drivers.kinect1.transport.packets import COLOR, DEPTH, INFRARED, PacketFormat
from evaluation.service.kinect1_emulation.bit_packing import pack
from evaluation.service.kinect1_emulation.packet_stream import PacketStream

#: Baselines, distance and pixel of the emulated calibration [cm], and its shift.
PLANE_CM, SHIFT = (7.5, 2.3, 120.0, 0.1042), 200

FORMS = {"depth": DEPTH, "color": COLOR, "ir": INFRARED}

# Register and value that start a stream, and its endpoint.
_SWITCHES = {"depth": (0x06, 2, 0x82), "color": (0x05, 1, 0x81), "ir": (0x05, 3, 0x81)}


class EmulatedKinect:
    """One camera.

    Args:
        packet_streams: by "depth", "color" and "ir".
        polls: number of empty reads before an answer.
        fixed_size: size of the fixed parameters [bytes]: 322, or 334 for late models.
    """

    def __init__(self, packet_streams: Mapping[str, PacketStream], polls: int = 1, fixed_size: int = 322) -> None:
        self.packet_streams = packet_streams
        self.registers: dict[int, int] = {0x15: 30}
        self.color_sensor: dict[int, int] = {0x09: 300, 0x106: 0x4012}
        self.written: list[tuple[int, int]] = []
        self.corrupt: Callable[[bytes], bytes] = lambda answer: answer
        self._polls = polls
        self._fixed_size = fixed_size
        self._waiting = 0
        self._answer = b""

    def request(self, data: bytes) -> None:
        """Handles a write of the host to the control endpoint."""
        length, opcode, tag = struct.unpack_from("<HHH", data, 2)
        assert data[:2] == b"GM"
        assert len(data) == 8 + 2 * length
        payload = self._execute(opcode, struct.unpack_from(f"<{length}H", data, 8))
        answer = b"RB" + struct.pack("<HHH", len(payload) // 2, opcode, tag) + payload
        self._answer, self._waiting = self.corrupt(answer), self._polls

    def answer(self, size: int) -> bytes:
        """Handles a read of the host from the control endpoint."""
        if self._waiting > 0:
            self._waiting -= 1
            return b""
        answer, self._answer = self._answer, b""
        return answer[:size]

    def microframes(self, endpoint: int, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Packets (count, PACKET_BYTES) of an endpoint and their lengths; empty if no stream is active."""
        for name, stream in self.packet_streams.items():
            register, value, pipe = _SWITCHES[name]
            if pipe == endpoint and self.registers.get(register) == value:
                return stream.microframes(first, count)
        return np.zeros((count, 1920), np.uint8), np.zeros(count, np.uint32)

    def _execute(self, opcode: int, words: tuple[int, ...]) -> bytes:
        match opcode, words:
            case 0x02, (register,):
                return struct.pack("<HH", 0, self.registers.get(register, 0))
            case 0x03, (register, value):
                self.registers[register] = value
                self.written.append((register, value))
                return bytes(2)
            case 0x04, (0, 0, 0, 0, 0):
                fixed = bytearray(self._fixed_size)
                struct.pack_into("<4f", fixed, 94, *PLANE_CM)
                return bytes(fixed)
            case 0x16, (0, 0, 1, 30, 0):
                return struct.pack("<HH", 0, SHIFT)
            case 0x95, (1, register, value):
                if register & 0x8000:
                    self.color_sensor[register & 0x7FFF] = value
                return struct.pack("<HHH", 1, register, self.color_sensor.get(register & 0x7FFF, 0))
        raise AssertionError(f"unknown command {opcode:#x} {words}")


def noise(images: int = 3, seed: int = 1) -> EmulatedKinect:
    """A camera with random pixels, so that images cannot be confused."""
    return EmulatedKinect({name: PacketStream(form, _random(form, images, seed)) for name, form in FORMS.items()})


@cache
def _random(form: PacketFormat, images: int, seed: int) -> list[bytes]:
    generator = np.random.default_rng(seed)
    pixels = [generator.integers(0, 1 << form.bits, (form.height, form.width)) for _ in range(images)]
    return [pack(image, form.bits) for image in pixels]

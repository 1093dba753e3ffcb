"""A Kinect as its host sees it: answers commands, shows films. It knows nothing of USB; what carries it does."""

import struct
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from drivers.kinect1.transport.packets import COLOR, DEPTH, INFRARED, PacketFormat
from tests.drivers.kinect1.film import Film
from tests.drivers.kinect1.packing import pack

#: Baselines, distance and pixel of the emulated calibration [cm], and its shift.
PLANE_CM, SHIFT = (7.5, 2.3, 120.0, 0.1042), 200

FORMS = {"depth": DEPTH, "color": COLOR, "ir": INFRARED}

# Which registers begin a stream with which value, and in which pipe it then comes.
_SWITCHES = {"depth": (0x06, 2, 0x82), "color": (0x05, 1, 0x81), "ir": (0x05, 3, 0x81)}


class EmulatedKinect:
    """One camera.

    Args:
        films: what its streams show, by "depth", "color" and "ir".
        polls: how often an answer is asked for in vain before it comes.
        fixed_size: bytes of its fixed parameters: 322, or 334 of the later models.
    """

    def __init__(self, films: Mapping[str, Film], polls: int = 1, fixed_size: int = 322) -> None:
        self.films = films
        self.registers: dict[int, int] = {0x15: 30}
        self.color_sensor: dict[int, int] = {0x09: 300, 0x106: 0x4012}
        self.written: list[tuple[int, int]] = []
        self.spoil: Callable[[bytes], bytes] = lambda answer: answer
        self._polls = polls
        self._fixed_size = fixed_size
        self._waiting = 0
        self._answer = b""

    def request(self, data: bytes) -> None:
        """Takes what the host writes to the control pipe."""
        length, opcode, tag = struct.unpack_from("<HHH", data, 2)
        assert data[:2] == b"GM"
        assert len(data) == 8 + 2 * length
        payload = self._execute(opcode, struct.unpack_from(f"<{length}H", data, 8))
        answer = b"RB" + struct.pack("<HHH", len(payload) // 2, opcode, tag) + payload
        self._answer, self._waiting = self.spoil(answer), self._polls

    def answer(self, size: int) -> bytes:
        """What the host reads from the control pipe."""
        if self._waiting > 0:
            self._waiting -= 1
            return b""
        answer, self._answer = self._answer, b""
        return answer[:size]

    def microframes(self, endpoint: int, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """What a pipe carries: packets (count, PACKET_BYTES) and their lengths; nothing if no stream is on."""
        for name, film in self.films.items():
            register, value, pipe = _SWITCHES[name]
            if pipe == endpoint and self.registers.get(register) == value:
                return film.microframes(first, count)
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
        raise AssertionError(f"the camera knows no command {opcode:#x} {words}")


def noise(images: int = 3, seed: int = 1) -> EmulatedKinect:
    """A camera whose pixels are random: no image can be taken for a part of another."""
    return EmulatedKinect({name: Film(form, _random(form, images, seed)) for name, form in FORMS.items()})


@cache
def _random(form: PacketFormat, images: int, seed: int) -> list[bytes]:
    generator = np.random.default_rng(seed)
    pixels = [generator.integers(0, 1 << form.bits, (form.height, form.width)) for _ in range(images)]
    return [pack(image, form.bits) for image in pixels]

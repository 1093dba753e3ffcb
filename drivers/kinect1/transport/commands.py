"""Command protocol of the control endpoint: tagged requests with polled answers."""

import struct
import threading
from collections.abc import Callable
from enum import IntEnum
from typing import Protocol

from drivers.contract.device import DeviceError

#: Magic numbers of requests and answers; then length in words, opcode and tag, 16 bits each, little-endian.
_REQUEST, _ANSWER = b"GM", b"RB"
_HEADER = struct.Struct("<HHH")

#: Write flag in register numbers of the colour sensor.
_WRITE = 0x8000

#: Size of answer requests; a result of this size, or an empty one, means that the answer is not ready.
ANSWER_BYTES = 512

#: Timeout of an answer, and polling interval [s].
TIMEOUT_S, PAUSE_S = 1.0, 0.002


class Opcode(IntEnum):
    """The commands used by this driver."""

    READ_REGISTER = 0x02
    WRITE_REGISTER = 0x03
    FIXED_PARAMETERS = 0x04
    ALGORITHM_PARAMETERS = 0x16
    COLOR_SENSOR = 0x95


class ProtocolError(DeviceError):
    """An invalid answer, or none."""


class Control(Protocol):
    """Control endpoint of a device."""

    def write(self, data: bytes) -> None:
        """Sends a request.

        Raises:
            DeviceError: the device is lost or refuses.
        """
        ...

    def read(self, size: int) -> bytes:
        """Reads up to `size` bytes of an answer; empty if it is not ready. Raises as `write`."""
        ...


class Commands:
    """Sends commands to one camera. Thread-safe.

    Args:
        control: its control endpoint.
        clock: CLOCK_MONOTONIC [ns].
        sleep: waits [s].
    """

    def __init__(self, control: Control, clock: Callable[[], int], sleep: Callable[[float], object]) -> None:
        self._control = control
        self._clock = clock
        self._sleep = sleep
        self._tag = 0
        self._lock = threading.Lock()

    def send(self, opcode: Opcode, *words: int) -> bytes:
        """Sends a command of 16-bit words; returns the payload of the answer.

        Raises:
            ProtocolError: timeout, or an answer to another command.
            DeviceError: the device is lost.
        """
        with self._lock:
            tag, self._tag = self._tag, (self._tag + 1) & 0xFFFF
            header = _HEADER.pack(len(words), opcode, tag)
            self._control.write(_REQUEST + header + struct.pack(f"<{len(words)}H", *words))
            answer = self._wait(opcode)
        if (
            len(answer) < 8
            or answer[:2] != _ANSWER
            or _HEADER.unpack_from(answer, 2)
            != (
                (len(answer) - 8) // 2,
                opcode,
                tag,
            )
        ):
            raise ProtocolError(
                f"the camera's answer to command 0x{opcode:02x} with tag {tag} is none: {answer[:8].hex(' ')} …; "
                "unplug it and plug it in again"
            )
        return answer[8:]

    def read_register(self, register: int) -> int:
        """Value of a register. Raises as `send`."""
        return _word(self.send(Opcode.READ_REGISTER, register), 1)

    def write_register(self, register: int, value: int) -> None:
        """Sets a register; the status in the answer is meaningless (other drivers ignore it, too). Raises as `send`."""
        self.send(Opcode.WRITE_REGISTER, register, value)

    def read_color_sensor(self, register: int) -> int:
        """Value of a register of the colour sensor. Raises as `send`."""
        return _word(self.send(Opcode.COLOR_SENSOR, 1, register, 0), 2)

    def write_color_sensor(self, register: int, value: int) -> None:
        """Sets a register of the colour sensor. Raises as `send`."""
        self.send(Opcode.COLOR_SENSOR, 1, register | _WRITE, value)

    def _wait(self, opcode: Opcode) -> bytes:
        deadline_ns = self._clock() + round(TIMEOUT_S * 1e9)
        while True:
            answer = self._control.read(ANSWER_BYTES)
            if 0 < len(answer) < ANSWER_BYTES:
                return answer
            if self._clock() > deadline_ns:
                raise ProtocolError(
                    f"the camera does not answer command 0x{opcode:02x} within {TIMEOUT_S:g} s; is its power supply in?"
                )
            self._sleep(PAUSE_S)


def _word(payload: bytes, place: int) -> int:
    if len(payload) < 2 * place + 2:
        raise ProtocolError(f"the camera's answer has {len(payload)} bytes, {2 * place + 2} are needed")
    return struct.unpack_from("<H", payload, 2 * place)[0]

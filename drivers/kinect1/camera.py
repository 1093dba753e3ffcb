"""Camera functions: start and stop of streams, exposure settings, and calibration."""

from enum import StrEnum

from drivers.kinect1 import reference_plane
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.transport.commands import Commands, Opcode
from drivers.kinect1.transport.packets import COLOR, DEPTH, INFRARED, PacketFormat


class Stream(StrEnum):
    """Streams of the camera; `COLOR` and `IR` share an endpoint, so only one of them is active."""

    DEPTH = "depth"
    COLOR = "color"
    IR = "ir"

    @property
    def form(self) -> PacketFormat:
        """Packet format of the stream."""
        return {Stream.DEPTH: DEPTH, Stream.COLOR: COLOR, Stream.IR: INFRARED}[self]


#: Register writes that start a stream, in order; the last disables mirroring.
_START = {
    Stream.DEPTH: ((0x105, 0), (0x06, 0), (0x12, 3), (0x13, 1), (0x14, 0x1E), (0x06, 2), (0x17, 0)),
    Stream.COLOR: ((0x0C, 0), (0x0D, 1), (0x0E, 0x1E), (0x05, 1), (0x47, 0)),
    Stream.IR: ((0x19, 0), (0x1A, 1), (0x1B, 0x1E), (0x105, 0), (0x05, 3), (0x48, 0)),
}
_STOP = {Stream.DEPTH: 0x06, Stream.COLOR: 0x05, Stream.IR: 0x05}

_INFRARED_GAIN = 0x15
_SHIFT_PARAMETERS = 0

# Registers of the colour sensor: exposure in lines, and bits of the automatic modes.
_EXPOSURE, _MODE = 0x09, 0x106
_AUTO_EXPOSURE, _AUTO_WHITE_BALANCE = 1 << 14, 1 << 1

#: Line time of the colour sensor [s].
LINE_S = 54.21e-6

#: The longest exposure at 30 images per second, in lines.
MAX_LINES = 614


class KinectCamera:
    """One camera on its control endpoint. All methods raise `DeviceError` for a lost camera or an invalid answer."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands

    def reference_plane(self) -> ReferencePlane:
        """Calibration of depth."""
        fixed = self._commands.send(Opcode.FIXED_PARAMETERS, 0, 0, 0, 0, 0)
        shift = self._commands.send(Opcode.ALGORITHM_PARAMETERS, _SHIFT_PARAMETERS, 0, 1, 30, 0)
        return reference_plane.parse(fixed, shift)

    def start(self, stream: Stream) -> None:
        """Starts a stream."""
        for register, value in _START[stream]:
            self._commands.write_register(register, value)

    def stop(self, stream: Stream) -> None:
        """Stops a stream."""
        self._commands.write_register(_STOP[stream], 0)

    def infrared_gain(self) -> int:
        """Gain of the infra-red camera, 1 to 50; depth is computed from its images."""
        return self._commands.read_register(_INFRARED_GAIN)

    def set_infrared_gain(self, gain: int) -> None:
        """See `infrared_gain`."""
        self._commands.write_register(_INFRARED_GAIN, gain)

    def exposure_s(self) -> float:
        """Exposure time of the colour camera [s]."""
        return self._commands.read_color_sensor(_EXPOSURE) * LINE_S

    def set_exposure_s(self, seconds: float) -> None:
        """Sets the exposure time to the nearest multiple of `LINE_S`; no effect during automatic exposure."""
        lines = min(max(round(seconds / LINE_S), 1), MAX_LINES)
        self._commands.write_color_sensor(_EXPOSURE, lines)

    def auto_exposure(self) -> bool:
        """True if automatic exposure is on."""
        return self._mode(_AUTO_EXPOSURE)

    def set_auto_exposure(self, on: bool) -> None:
        """See `auto_exposure`."""
        self._set_mode(_AUTO_EXPOSURE, on)

    def auto_white_balance(self) -> bool:
        """True if automatic white balance is on; it also affects raw images."""
        return self._mode(_AUTO_WHITE_BALANCE)

    def set_auto_white_balance(self, on: bool) -> None:
        """See `auto_white_balance`."""
        self._set_mode(_AUTO_WHITE_BALANCE, on)

    def _mode(self, bit: int) -> bool:
        return bool(self._commands.read_color_sensor(_MODE) & bit)

    def _set_mode(self, bit: int, on: bool) -> None:
        others = self._commands.read_color_sensor(_MODE) & ~bit
        self._commands.write_color_sensor(_MODE, others | bit if on else others)

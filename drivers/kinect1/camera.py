"""What the camera can be told: to begin and end its streams, to expose, and to tell its calibration."""

from enum import StrEnum

from drivers.kinect1 import reference_plane
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.transport.commands import Commands, Opcode
from drivers.kinect1.transport.packets import COLOR, DEPTH, INFRARED, PacketFormat


class Stream(StrEnum):
    """What the camera delivers: `COLOR` and `IR` share a pipe, so only one of them at a time."""

    DEPTH = "depth"
    COLOR = "color"
    IR = "ir"

    @property
    def form(self) -> PacketFormat:
        """How its images come."""
        return {Stream.DEPTH: DEPTH, Stream.COLOR: COLOR, Stream.IR: INFRARED}[self]


#: Registers and their values that begin a stream, in this order; the last turns the mirror image off.
_START = {
    Stream.DEPTH: ((0x105, 0), (0x06, 0), (0x12, 3), (0x13, 1), (0x14, 0x1E), (0x06, 2), (0x17, 0)),
    Stream.COLOR: ((0x0C, 0), (0x0D, 1), (0x0E, 0x1E), (0x05, 1), (0x47, 0)),
    Stream.IR: ((0x19, 0), (0x1A, 1), (0x1B, 0x1E), (0x105, 0), (0x05, 3), (0x48, 0)),
}
_STOP = {Stream.DEPTH: 0x06, Stream.COLOR: 0x05, Stream.IR: 0x05}

_INFRARED_GAIN = 0x15
_SHIFT_PARAMETERS = 0

# The colour camera's chip: exposure in lines, and bits of what it decides by itself.
_EXPOSURE, _MODE = 0x09, 0x106
_AUTO_EXPOSURE, _AUTO_WHITE_BALANCE = 1 << 14, 1 << 1

#: Time that the colour camera's chip takes for a line [s].
LINE_S = 54.21e-6

#: The longest exposure at 30 images per second, in lines.
LONGEST_LINES = 614


class KinectCamera:
    """One camera on its control pipe. Every method raises `DeviceError` if the camera is gone or answers nonsense."""

    def __init__(self, commands: Commands) -> None:
        self._commands = commands

    def reference_plane(self) -> ReferencePlane:
        """The calibration of depth."""
        fixed = self._commands.send(Opcode.FIXED_PARAMETERS, 0, 0, 0, 0, 0)
        shift = self._commands.send(Opcode.ALGORITHM_PARAMETERS, _SHIFT_PARAMETERS, 0, 1, 30, 0)
        return reference_plane.parse(fixed, shift)

    def start(self, stream: Stream) -> None:
        """Begins a stream."""
        for register, value in _START[stream]:
            self._commands.write_register(register, value)

    def stop(self, stream: Stream) -> None:
        """Ends a stream."""
        self._commands.write_register(_STOP[stream], 0)

    def infrared_gain(self) -> int:
        """Gain of the infra-red camera, 1 to 50; depth is made of its images."""
        return self._commands.read_register(_INFRARED_GAIN)

    def set_infrared_gain(self, gain: int) -> None:
        """See `infrared_gain`."""
        self._commands.write_register(_INFRARED_GAIN, gain)

    def exposure_s(self) -> float:
        """Exposure time of the colour camera [s]."""
        return self._commands.read_color_sensor(_EXPOSURE) * LINE_S

    def set_exposure_s(self, seconds: float) -> None:
        """Sets the exposure time to the nearest multiple of `LINE_S`; of no effect while it is automatic."""
        lines = min(max(round(seconds / LINE_S), 1), LONGEST_LINES)
        self._commands.write_color_sensor(_EXPOSURE, lines)

    def auto_exposure(self) -> bool:
        """Whether the colour camera chooses its exposure by itself."""
        return self._mode(_AUTO_EXPOSURE)

    def set_auto_exposure(self, on: bool) -> None:
        """See `auto_exposure`."""
        self._set_mode(_AUTO_EXPOSURE, on)

    def auto_white_balance(self) -> bool:
        """Whether the colour camera weighs its channels by itself; that changes raw images as well."""
        return self._mode(_AUTO_WHITE_BALANCE)

    def set_auto_white_balance(self, on: bool) -> None:
        """See `auto_white_balance`."""
        self._set_mode(_AUTO_WHITE_BALANCE, on)

    def _mode(self, bit: int) -> bool:
        return bool(self._commands.read_color_sensor(_MODE) & bit)

    def _set_mode(self, bit: int, on: bool) -> None:
        others = self._commands.read_color_sensor(_MODE) & ~bit
        self._commands.write_color_sensor(_MODE, others | bit if on else others)

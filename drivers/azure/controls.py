"""Controls of the colour camera, and those that are sent when streams start: synchronisation and delays."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from drivers.azure.address import FORMATS, RATES_HZ, Address
from drivers.azure.calibration import COLOR_MODES, DEPTH_MODES
from drivers.azure.kinect import Kinect
from drivers.azure.library import Configuration
from drivers.contract.capabilities import SyncRole
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.device import DeviceError

#: The SDK's commands.
_EXPOSURE, _WHITE_BALANCE, _GAIN, _POWERLINE = 0, 6, 8, 9
_AUTOMATIC, _MANUAL = 0, 1
#: Values of the SDK by the frequency of the mains [Hz], whose flicker exposures avoid.
_MAINS: Mapping[str, int] = {"50": 1, "60": 2}
_ROLES = (SyncRole.FREE, SyncRole.MASTER, SyncRole.SLAVE)


@dataclass(slots=True)
class Start:
    """Values that are sent when streams start, and stay until they end.

    Attributes:
        address: of the camera.
        values: of the controls, by name.
        streams: True while streams run.
    """

    address: Address
    values: dict[str, Value] = field(
        default_factory=lambda: {"sync_role": SyncRole.FREE.value, "sync_delay_s": 0.0, "depth_delay_s": 0.0}
    )
    streams: bool = False

    def configuration(self) -> Configuration:
        """The SDK's configuration of the streams."""
        address, role = self.address, SyncRole(str(self.values["sync_role"]))
        return Configuration(
            color_format=FORMATS.index(address.format),
            color_resolution=[*COLOR_MODES].index(address.color) + 1 if address.color else 0,
            depth_mode=[*DEPTH_MODES].index(address.depth) + 1 if address.depth else 0,
            camera_fps=RATES_HZ.index(address.rate_hz),
            synchronized_images_only=False,  # images are paired by this program, and one that is lost costs no other
            depth_delay_off_color_usec=round(float(self.values["depth_delay_s"]) * 1e6),
            wired_sync_mode=_ROLES.index(role),
            # The SDK refuses a delay of any other role.
            subordinate_delay_off_master_usec=round(float(self.values["sync_delay_s"]) * 1e6)
            * (role == SyncRole.SLAVE),
            disable_streaming_indicator=False,
        )

    def control(self, info: ControlInfo) -> Control:
        """Control of one of the values."""

        def write(value: Value) -> None:
            if self.streams and value != self.values[info.name]:
                raise DeviceError(f"{self.address.uri}: {info.name} is set before the streams start, in the rig file")
            self.values[info.name] = value

        return Control(info, lambda: self.values[info.name], write)


def sync_roles(address: Address) -> tuple[SyncRole, ...]:
    """Roles that the camera can have; a master has to take colours."""
    return _ROLES if address.color else (SyncRole.FREE, SyncRole.SLAVE)


def make(kinect: Kinect, start: Start) -> Controls:
    """Controls of an open camera."""
    address, period_s = start.address, 1 / start.address.rate_hz
    roles = tuple(role.value for role in sync_roles(address))
    infos = [
        ControlInfo("sync_role", ControlKind.CHOICE, choices=roles),
        ControlInfo("sync_delay_s", ControlKind.NUMBER, "s", 0.0, period_s),
    ]
    if address.depth and address.color:
        infos.append(ControlInfo("depth_delay_s", ControlKind.NUMBER, "s", -period_s, period_s))
    return Controls([*map(start.control, infos), *(_of_colors(kinect) if address.color else ())])


def _of_colors(kinect: Kinect) -> Iterator[Control]:
    yield _number(kinect, _EXPOSURE, "color.exposure_s", "s", 1e-6)
    yield _switch(kinect, _EXPOSURE, "color.auto_exposure")
    yield _number(kinect, _WHITE_BALANCE, "color.white_balance", "K")
    yield _switch(kinect, _WHITE_BALANCE, "color.auto_white_balance")
    yield _number(kinect, _GAIN, "color.gain", "")
    names = {number: hertz for hertz, number in _MAINS.items()}
    yield Control(
        ControlInfo("color.mains_hz", ControlKind.CHOICE, choices=tuple(_MAINS)),
        lambda: names.get(kinect.control(_POWERLINE)[1], "60"),
        lambda value: kinect.set_control(_POWERLINE, _MANUAL, _MAINS[str(value)]),
    )


def _number(kinect: Kinect, command: int, name: str, unit: str, scale: float = 1.0) -> Control:
    """A number in SI units; setting it ends the automatic."""
    limits = kinect.limits(command)
    kind = ControlKind.NUMBER if unit == "s" else ControlKind.WHOLE

    def read() -> Value:
        value = kinect.control(command)[1]
        return value * scale if kind == ControlKind.NUMBER else value

    def write(value: Value) -> None:
        wanted = round(float(value) / scale)
        if kind == ControlKind.WHOLE:  # of exposures the SDK has a table, and takes the next longer one
            wanted = limits.minimum + limits.step * round((wanted - limits.minimum) / limits.step)
        kinect.set_control(command, _MANUAL, wanted)

    return Control(ControlInfo(name, kind, unit, limits.minimum * scale, limits.maximum * scale), read, write)


def _switch(kinect: Kinect, command: int, name: str) -> Control:
    def write(value: Value) -> None:
        kinect.set_control(command, _AUTOMATIC if value else _MANUAL, kinect.control(command)[1])

    return Control(ControlInfo(name, ControlKind.SWITCH), lambda: kinect.control(command)[0] == _AUTOMATIC, write)

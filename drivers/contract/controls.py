"""Controls: parameters of an open device, such as exposure, gain, laser power and modulation range.

Names end in their SI unit (`exposure_s`) and mean the same on every device. Common controls:
`exposure_s`, `auto_exposure`, `gain`, `laser_power` (fraction of the maximum, 0 to 1), `modulation`, `sync_role`.
"""

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.errors import ControlError

Value = bool | int | float | str


class ControlKind(StrEnum):
    """Type of a control's values."""

    SWITCH = "switch"  # true or false
    WHOLE = "whole"  # int
    NUMBER = "number"  # float
    CHOICE = "choice"  # one of several strings


@dataclass(frozen=True, slots=True)
class ControlInfo:
    """Type and limits of one control.

    Attributes:
        name: of the control.
        kind: of its values.
        unit: SI unit of a number, "" if it has none.
        minimum, maximum: limits of a number, inclusive.
        choices: allowed strings of a choice.
    """

    name: str
    kind: ControlKind
    unit: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """Description of the allowed values for error messages."""
        match self.kind:
            case ControlKind.SWITCH:
                return "true or false"
            case ControlKind.CHOICE:
                return f"one of {', '.join(self.choices)}"
        noun = "a whole number" if self.kind == ControlKind.WHOLE else "a number"
        return f"{noun} from {self.minimum:g} to {self.maximum:g} {self.unit}".rstrip()

    def checked(self, value: Value) -> Value:
        """Validated value, converted to the control's type: an int for a NUMBER becomes a float.

        Raises:
            ControlError: wrong type, not finite, or out of range; names the allowed values.
        """
        match self.kind, value:
            case (ControlKind.SWITCH, bool()):
                return value
            case (ControlKind.CHOICE, str()) if value in self.choices:
                return value
            case (ControlKind.SWITCH | ControlKind.CHOICE, _) | (_, bool()):
                pass
            case (ControlKind.WHOLE, int()) if self.minimum <= value <= self.maximum:
                return value
            case (ControlKind.NUMBER, int() | float()) if self.minimum <= value <= self.maximum and math.isfinite(
                value
            ):
                return float(value)
        raise ControlError(self.name, json.dumps(value, default=repr), f"must be {self.allowed}")


@dataclass(frozen=True, slots=True)
class Control:
    """A control with its read and write functions; both may raise `DeviceError` if the device does not answer.

    A driver that can only access its device while it streams keeps the value and sends it at start.
    """

    info: ControlInfo
    read: Callable[[], Value]
    write: Callable[[Value], None]


class Controls:
    """All controls of one device; values are validated before they are sent to the device.

    `Controls()` is the null object of a device without controls.

    Args:
        controls: of the device; each name once.
    """

    def __init__(self, controls: Iterable[Control] = ()) -> None:
        self._controls = {control.info.name: control for control in controls}

    @property
    def infos(self) -> tuple[ControlInfo, ...]:
        """All controls, for `drivers.contract.capabilities.Capabilities`."""
        return tuple(control.info for control in self._controls.values())

    def get(self, name: str) -> Value:
        """Current value of a control.

        Raises:
            ControlError: no such control; names the existing ones.
            DeviceError: the device does not answer.
        """
        return self._find(name).read()

    def set(self, name: str, value: Value) -> None:
        """Sets the control.

        Raises:
            ControlError: no such control, or a value that is not allowed; names the allowed values.
            DeviceError: the device does not answer.
        """
        control = self._find(name)
        control.write(control.info.checked(value))

    def _find(self, name: str) -> Control:
        if name not in self._controls:
            there_are = f"it has: {', '.join(sorted(self._controls))}" if self._controls else "it has none"
            raise ControlError(name, "", f"the device has no such control, {there_are}")
        return self._controls[name]

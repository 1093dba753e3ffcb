"""What can be set on a device while it is open: exposure, gain, laser power, modulation range and the like.

The names end in their SI unit (`exposure_s`); two devices with a control of one name mean the same by it. Usual ones:
`exposure_s`, `auto_exposure`, `gain`, `laser_power` (share of the greatest, 0 to 1), `modulation`, `sync_role`.
"""

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from drivers.contract.errors import ControlError

Value = bool | int | float | str


class ControlKind(StrEnum):
    """What values a control takes."""

    SWITCH = "switch"  # true or false
    WHOLE = "whole"  # int
    NUMBER = "number"  # float
    CHOICE = "choice"  # one of some words


@dataclass(frozen=True, slots=True)
class ControlInfo:
    """What one control is and allows.

    Attributes:
        name: of the control.
        kind: of its values.
        unit: SI unit of a number, "" if it has none.
        minimum, maximum: limits of a number, both included.
        choices: the words of a choice.
    """

    name: str
    kind: ControlKind
    unit: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """What may be given, in plain words."""
        match self.kind:
            case ControlKind.SWITCH:
                return "true or false"
            case ControlKind.CHOICE:
                return f"one of {', '.join(self.choices)}"
        noun = "a whole number" if self.kind == ControlKind.WHOLE else "a number"
        return f"{noun} from {self.minimum:g} to {self.maximum:g} {self.unit}".rstrip()

    def checked(self, value: Value) -> Value:
        """`value` as the device takes it: a float for a number, even if a whole one was given.

        Raises:
            ControlError: not of this kind, not finite, or out of range; says what is allowed.
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
    """A control with the functions that reach the device; either may raise `DeviceError` if the device does not answer.

    A driver that reaches its device only while it streams keeps the value and sends it when it starts.
    """

    info: ControlInfo
    read: Callable[[], Value]
    write: Callable[[Value], None]


class Controls:
    """All controls of one device. Nothing reaches the device that the control does not allow.

    `Controls()` is what a device has that can set nothing.

    Args:
        controls: of the device; each name once.
    """

    def __init__(self, controls: Iterable[Control] = ()) -> None:
        self._controls = {control.info.name: control for control in controls}

    @property
    def infos(self) -> tuple[ControlInfo, ...]:
        """What can be set, for `drivers.contract.capabilities.Capabilities`."""
        return tuple(control.info for control in self._controls.values())

    def get(self, name: str) -> Value:
        """What the control is set to.

        Raises:
            ControlError: no such control; names those that there are.
            DeviceError: the device does not answer.
        """
        return self._find(name).read()

    def set(self, name: str, value: Value) -> None:
        """Sets the control.

        Raises:
            ControlError: no such control, or a value that it does not take; says what is allowed.
            DeviceError: the device does not answer.
        """
        control = self._find(name)
        control.write(control.info.checked(value))

    def _find(self, name: str) -> Control:
        if name not in self._controls:
            there_are = f"it has: {', '.join(sorted(self._controls))}" if self._controls else "it has none"
            raise ControlError(name, "", f"the device has no such control, {there_are}")
        return self._controls[name]

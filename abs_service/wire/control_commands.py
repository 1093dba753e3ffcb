"""Commands to the devices of a rig: set controls, list controls."""

import json
from collections.abc import Callable, Mapping

from absmsg.v1.command_pb2 import CommandAnswer, Control, SetControls

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Subscription
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory
from abs_service.wire import commands
from drivers.contract.controls import ControlInfo, ControlKind, Value
from drivers.contract.device import DeviceError
from drivers.contract.text import printable

#: Sets controls by name, and returns all that the device has, with their values.
Act = Callable[[Mapping[str, Value]], Mapping[ControlInfo, Value]]


def answer_controls(bus: Bus, device: str, headers: HeaderFactory, health: Health, act: Act) -> Subscription:
    """Answers requests to set controls of a device; counts and logs them as `commands.answer_reinitialize`.

    `act` is called in a thread of the transport, and may raise DeviceError.
    """

    def on_command(payload: bytes) -> CommandAnswer:
        try:
            found = act(_wanted(payload))
        except DeviceError as error:
            raise commands.RefusedError(str(error)) from None
        return CommandAnswer(controls=[_message(info, value) for info, value in found.items()])

    def which(payload: bytes) -> str:
        wanted = SetControls.FromString(payload).controls
        return "".join(f" {one.name} = {json.dumps(value(one))}" for one in wanted)

    topic = keys.controls(device)
    return commands.answer_valid(bus, topic, commands.SET_CONTROLS, headers, health, on_command, which)


def set_controls(
    bus: Bus, device: str, headers: HeaderFactory, timeout_s: float, values: Mapping[str, Value]
) -> CommandAnswer | None:
    """Asks a device to set controls, or without any to list them; returns its answer, None if there is none."""
    command = SetControls(header=headers.now(0), device=device)
    for name, wanted in values.items():
        command.controls.add(name=name, **{_FIELDS[type(wanted)]: wanted})
    return commands.ask(bus, keys.controls(device), command, timeout_s)


def value(control: Control) -> Value | None:
    """The value in a message, None if it has none."""
    field = control.WhichOneof("value")
    return getattr(control, field) if field else None


def _wanted(payload: bytes) -> dict[str, Value]:
    wanted = {one.name: value(one) for one in SetControls.FromString(payload).controls}
    found = {name: one for name, one in wanted.items() if one is not None}
    if len(found) < len(wanted):
        raise commands.RefusedError(f"no value: {', '.join(sorted(wanted.keys() - found.keys()))}")
    return found


def _message(info: ControlInfo, now: Value) -> Control:
    message = Control(name=printable(info.name), unit=printable(info.unit), minimum=info.minimum, maximum=info.maximum)
    message.choices.extend(map(printable, info.choices))
    kind = _TYPES[info.kind]
    setattr(message, _FIELDS[kind], kind(now))
    return message


_TYPES: Mapping[ControlKind, type[Value]] = {
    ControlKind.SWITCH: bool,
    ControlKind.WHOLE: int,
    ControlKind.NUMBER: float,
    ControlKind.CHOICE: str,
}
_FIELDS: Mapping[type[Value], str] = {bool: "on", int: "whole", float: "number", str: "choice"}

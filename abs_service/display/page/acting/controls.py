"""Controls of a rig's devices on the page, such as exposure times: read, and set, when a button is pressed."""

import json
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import viser
from absmsg.v1.command_pb2 import CommandAnswer, Control

from abs_service.wire.control_commands import value
from drivers.contract.controls import Value

#: Sets controls of a device, or without any lists them; returns its answer, None if there is none.
Send = Callable[[str, Mapping[str, Value]], CommandAnswer | None]

#: An input of the page; a number is a text, because the device knows its limits.
Input = viser.GuiInputHandle[Any]


class DeviceControls:
    """Inputs for the controls of every device, once the user has asked for them."""

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle, devices: Sequence[str], send: Send) -> None:
        self._gui, self._tab, self._devices, self._send = gui, tab, devices, send
        self._folders: dict[str, viser.GuiFolderHandle] = {}
        self._known: dict[str, dict[str, Control]] = {}  # by device and name, as last reported
        self._inputs: dict[str, dict[str, Input]] = {}
        self._lock = threading.Lock()  # buttons are pressed in threads of the server
        with tab:
            read = gui.add_button("Read the controls", hint="Ask every device what can be set, and how it is set now")
            self._answer = gui.add_markdown("Exposure, gain and light, as far as a device can set them.")
        read.on_click(lambda _: self.read())

    def read(self) -> None:
        """Asks every device for its controls, and shows them."""
        with self._lock:
            answers = {device: self._send(device, {}) for device in self._devices}
            for device, answer in answers.items():
                if answer is not None and answer.accepted:
                    self._show(device, answer.controls)
            self._answer.content = "\n\n".join(filter(None, map(_answer_text, answers, answers.values())))

    def set(self, device: str) -> None:
        """Sets what the user has changed, and shows how the controls are then."""
        with self._lock:
            known, inputs = self._known[device], self._inputs[device]
            try:
                changed = {
                    name: _parsed(known[name], one.value)
                    for name, one in inputs.items()
                    if one.value != _shown(known[name])
                }
            except ValueError as error:
                self._answer.content = f"{error}."
                return
            # Switches first: some cameras take an exposure time only when the automatic one is off.
            changed = dict(sorted(changed.items(), key=lambda one: not isinstance(one[1], bool)))
            answer = self._send(device, changed)
            if answer is not None and answer.accepted:
                self._show(device, answer.controls)
            self._answer.content = _answer_text(device, answer) or _kept(device, changed)

    def _show(self, device: str, controls: Iterable[Control]) -> None:
        now = {one.name: one for one in controls}
        if now.keys() != self._known.get(device, {}).keys():
            if (before := self._folders.pop(device, None)) is not None:
                before.remove()
            with self._tab:
                folder = self._folders[device] = self._gui.add_folder(device)
            with folder:
                self._inputs[device] = {name: self._input(one) for name, one in now.items()}
                self._gui.add_button("Set").on_click(partial(self._pressed, device))
        self._known[device] = now
        for name, one in now.items():
            self._inputs[device][name].value = _shown(one)

    def _input(self, control: Control) -> Input:
        match control.WhichOneof("value"):
            case "on":
                return self._gui.add_checkbox(control.name, control.on)
            case "choice":
                return self._gui.add_dropdown(control.name, tuple(dict.fromkeys((*control.choices, control.choice))))
        label = f"{control.name} [{control.unit}]" if control.unit else control.name
        limits = f"{control.minimum:.4g} to {control.maximum:.4g} {control.unit}".rstrip()
        return self._gui.add_text(label, str(_shown(control)), hint=limits)

    def _pressed(self, device: str, _: object) -> None:
        self.set(device)


def _shown(control: Control) -> bool | str:
    """The value of a control as its input has it."""
    match now := value(control):
        case bool() | str():
            return now
        case float():
            return f"{now:.6g}"
    return str(now)


def _parsed(control: Control, given: bool | str) -> Value:
    """The value of an input, of the control's type; raises ValueError with what is allowed."""
    kinds: Mapping[str, tuple[Callable[[str], Value], str]] = {
        "whole": (int, "a whole number"),
        "number": (float, "a number"),
    }
    convert, noun = kinds.get(control.WhichOneof("value") or "", (lambda same: same, ""))
    try:
        return convert(given)
    except ValueError:
        raise ValueError(f"{control.name} = {json.dumps(given)}: must be {noun}") from None


def _answer_text(device: str, answer: CommandAnswer | None) -> str:
    """Text of an answer that needs no action."""
    if answer is None:
        return f"{device} gives no answer. Is it captured?"
    if not answer.accepted:
        return f"{device} refuses: {answer.reason}."
    return "" if answer.controls else f"{device} has no controls."


def _kept(device: str, changed: Mapping[str, Value]) -> str:
    lines = (f"{json.dumps(name) if '.' in name else name} = {json.dumps(now)}\n" for name, now in changed.items())
    if not changed:
        return "Nothing was changed."
    return (
        f"Set. To keep this choice, write into the rig file:\n```toml\n[devices.{device}.controls]\n{''.join(lines)}```"
    )

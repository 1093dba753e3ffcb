"""Controls of a camera, from its features."""

from collections.abc import Iterator, Mapping
from typing import Any

from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.genicam.features import settable, value
from drivers.genicam.link import CameraLink

#: Numbers: control, its unit, and units per unit of the feature.
_NUMBERS: Mapping[str, tuple[str, str, float]] = {
    "ExposureTime": ("exposure_s", "s", 1e-6),
    "Gain": ("gain", "", 1.0),
}
#: Choices; the names of exposure times and operating modes are the manufacturer's.
_CHOICES: Mapping[str, str] = {
    "OperatingMode": "modulation",
    "Scan3dOperatingMode": "modulation",
    "ExposureTimeSelector": "exposure",
}
#: Switches, with the feature's values for false and true.
_SWITCHES: Mapping[str, tuple[str, Value, Value]] = {
    "ExposureAuto": ("auto_exposure", "Off", "Continuous"),
    "PtpEnable": ("ptp", False, True),
}


def make(link: CameraLink) -> Controls:
    """Controls of those features that can be set."""
    return Controls({control.info.name: control for control in _found(link)}.values())


def exposure_s(nodes: Any) -> float:
    """Exposure at this moment [s], NaN if the camera does not report it."""
    time_us = value(nodes, "ExposureTime")
    return float("nan") if time_us is None else time_us * 1e-6


def _found(link: CameraLink) -> Iterator[Control]:
    nodes = link.nodes
    for feature, (name, unit, factor) in _NUMBERS.items():
        if (node := settable(nodes, feature)) is not None:
            info = ControlInfo(name, ControlKind.NUMBER, unit, node.min * factor, node.max * factor)
            yield _control(link, feature, info, lambda raw, k=factor: raw * k, lambda given, k=factor: given / k)
    for feature, name in _CHOICES.items():
        if (node := settable(nodes, feature)) is not None:
            yield _control(link, feature, ControlInfo(name, ControlKind.CHOICE, choices=tuple(node.symbolics)))
    for feature, (name, off, on) in _SWITCHES.items():
        if settable(nodes, feature) is not None:
            info = ControlInfo(name, ControlKind.SWITCH)
            yield _control(link, feature, info, lambda raw, o=off: raw != o, lambda given, v=(off, on): v[bool(given)])


def _control(
    link: CameraLink, feature: str, info: ControlInfo, shown: Any = lambda raw: raw, sent: Any = lambda given: given
) -> Control:
    def read() -> Value:
        with link.translated_errors():
            return shown(getattr(link.nodes, feature).value)

    def write(given: Value) -> None:
        with link.translated_errors():
            getattr(link.nodes, feature).value = sent(given)

    return Control(info, read, write)

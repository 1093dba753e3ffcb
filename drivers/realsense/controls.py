"""Controls of a RealSense, from librealsense's options."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.realsense.library import translated_errors
from drivers.realsense.streams import Role

#: Values of librealsense's inter-camera synchronisation mode, by role.
_SYNC: Mapping[str, int] = {"free": 0, "master": 1, "slave": 2}


def make(rs: Any, uri: str, sensors: Sequence[tuple[Any, Role]]) -> Controls:
    """Controls of the used sensors; those of the colour sensor have the prefix `color.`."""
    controls: list[Control] = []
    for sensor, role in sensors:
        prefix = "color." if role.sensor == "color" else ""
        controls += _of_sensor(rs, uri, sensor, prefix, role.exposure_unit_s)
    return Controls(controls)


def can_sync(rs: Any, sensors: Sequence[tuple[Any, Role]]) -> bool:
    """True if the camera supports hardware synchronisation with others."""
    return any(sensor.supports(rs.option.inter_cam_sync_mode) for sensor, _ in sensors)


def _of_sensor(rs: Any, uri: str, sensor: Any, prefix: str, exposure_unit_s: float) -> Iterator[Control]:
    option = rs.option
    numbers = (
        ("exposure_s", option.exposure, "s", exposure_unit_s),
        ("gain", option.gain, "", 1.0),
        ("laser_power", option.laser_power, "", None),
    )
    for name, key, unit, scale in numbers:
        if _settable(sensor, key):
            yield _number(uri, sensor, key, f"{prefix}{name}", unit, scale)
    for name, key in (("auto_exposure", option.enable_auto_exposure), ("emitter", option.emitter_enabled)):
        if _settable(sensor, key):
            yield _switch(uri, sensor, key, f"{prefix}{name}")
    if not prefix and _settable(sensor, option.inter_cam_sync_mode):
        yield _sync(uri, sensor, option.inter_cam_sync_mode)


def _settable(sensor: Any, key: Any) -> bool:
    return sensor.supports(key) and not sensor.is_option_read_only(key)


def _number(uri: str, sensor: Any, key: Any, name: str, unit: str, scale: float | None) -> Control:
    """An option as a number in SI units; without a scale, as fraction of its maximum."""
    limits = sensor.get_option_range(key)
    factor = scale if scale is not None else 1 / max(limits.max, 1e-9)

    def read() -> Value:
        with translated_errors(uri):
            return float(sensor.get_option(key)) * factor

    def write(value: Value) -> None:
        steps = round((float(value) / factor - limits.min) / limits.step) if limits.step > 0 else 0
        with translated_errors(uri):
            sensor.set_option(key, limits.min + steps * limits.step if limits.step > 0 else float(value) / factor)

    return Control(ControlInfo(name, ControlKind.NUMBER, unit, limits.min * factor, limits.max * factor), read, write)


def _switch(uri: str, sensor: Any, key: Any, name: str) -> Control:
    def read() -> Value:
        with translated_errors(uri):
            return bool(sensor.get_option(key))

    def write(value: Value) -> None:
        with translated_errors(uri):
            sensor.set_option(key, float(bool(value)))

    return Control(ControlInfo(name, ControlKind.SWITCH), read, write)


def _sync(uri: str, sensor: Any, key: Any) -> Control:
    def read() -> Value:
        with translated_errors(uri):
            mode = int(sensor.get_option(key))
        return next((word for word, number in _SYNC.items() if number == mode), "slave")

    def write(value: Value) -> None:
        with translated_errors(uri):
            sensor.set_option(key, float(_SYNC[str(value)]))

    return Control(ControlInfo("sync_role", ControlKind.CHOICE, choices=tuple(_SYNC)), read, write)

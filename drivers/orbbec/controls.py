"""Controls of an Orbbec camera, from the SDK's properties.

Exposures are in the camera's own units: the SDK documents none, and they differ (100 µs for colours and 1 µs for depth
of a Gemini 330; unknown for a Femto), so they are no `exposure_s`.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.device import DeviceError
from drivers.orbbec.library import translated_errors

#: Names by the SDK's property; of several with one name, the first that the camera has.
_SWITCHES: Mapping[str, str] = {
    "OB_PROP_DEPTH_AUTO_EXPOSURE_BOOL": "auto_exposure",
    "OB_PROP_IR_AUTO_EXPOSURE_BOOL": "auto_exposure",
    "OB_PROP_COLOR_AUTO_EXPOSURE_BOOL": "color.auto_exposure",
    "OB_PROP_COLOR_AUTO_WHITE_BALANCE_BOOL": "color.auto_white_balance",
    "OB_PROP_LASER_BOOL": "laser",
    "OB_PROP_LDP_BOOL": "laser_protection",
}
_NUMBERS: Mapping[str, str] = {
    "OB_PROP_DEPTH_EXPOSURE_INT": "exposure",
    "OB_PROP_IR_EXPOSURE_INT": "exposure",
    "OB_PROP_DEPTH_GAIN_INT": "gain",
    "OB_PROP_IR_GAIN_INT": "gain",
    "OB_PROP_LASER_POWER_LEVEL_CONTROL_INT": "laser_level",
    "OB_PROP_COLOR_EXPOSURE_INT": "color.exposure",
    "OB_PROP_COLOR_GAIN_INT": "color.gain",
    "OB_PROP_COLOR_WHITE_BALANCE_INT": "color.white_balance",
}
#: Filters of depth.
_FILTERS: Mapping[str, str] = {
    "OB_PROP_DEPTH_NOISE_REMOVAL_FILTER_BOOL": "noise_removal",
    "OB_PROP_HW_NOISE_REMOVE_FILTER_ENABLE_BOOL": "noise_removal_in_camera",
}
#: Modes of synchronisation by role; the first that the camera has.
_SYNC: Mapping[str, tuple[str, ...]] = {
    "free": ("STANDALONE", "FREE_RUN"),
    "master": ("PRIMARY",),
    "slave": ("SECONDARY", "SECONDARY_SYNCED"),
}


def make(ob: Any, uri: str, camera: Callable[[], Any]) -> Controls:
    """Controls of a camera; those of its colour sensor have the prefix `color.`.

    Args:
        ob: pyorbbecsdk.
        uri: of the camera, for messages.
        camera: returns the `ob.Device`, or raises a DeviceError when it was closed: controls do not keep it open.
    """
    found: dict[str, Control] = {}
    for key, name in _SWITCHES.items():
        if name not in found and _settable(ob, camera(), key):
            found[name] = _switch(ob, uri, camera, key, name)
    for key, name in _NUMBERS.items():
        if name not in found and _settable(ob, camera(), key):
            found[name] = _number(ob, uri, camera, key, name)
    modes = sync_modes(ob, camera())
    return Controls([*found.values(), *_sync(uri, camera, modes)])


def sync_modes(ob: Any, camera: Any) -> Mapping[str, Any]:
    """The SDK's mode of each role that the camera supports; empty without hardware synchronisation."""
    try:
        bits = int(camera.get_supported_multi_device_sync_mode_bitmap())
    except Exception:  # the SDK's own exception, for cameras and recordings without it
        return {}
    modes = ob.OBMultiDeviceSyncMode.__members__
    there = {
        role: next((modes[name] for name in names if bits & int(modes[name])), None) for role, names in _SYNC.items()
    }
    return {role: mode for role, mode in there.items() if mode is not None}


def filters(ob: Any, camera: Any) -> tuple[str, ...]:
    """Filters of depth that are switched on; they are no controls, so they stay as they are while it streams."""
    return tuple(name for key, name in _FILTERS.items() if _is_on(ob, camera, key))


def _is_on(ob: Any, camera: Any, key: str) -> bool:
    number = ob.OBPropertyID.__members__[key]
    readable = camera.is_property_supported(number, ob.OBPermissionType.PERMISSION_READ)
    return readable and bool(camera.get_bool_property(number))


def _settable(ob: Any, camera: Any, key: str) -> bool:
    return camera.is_property_supported(ob.OBPropertyID.__members__[key], ob.OBPermissionType.PERMISSION_READ_WRITE)


def _switch(ob: Any, uri: str, camera: Callable[[], Any], key: str, name: str) -> Control:
    number = ob.OBPropertyID.__members__[key]

    def read() -> Value:
        with translated_errors(uri):
            return bool(camera().get_bool_property(number))

    def write(value: Value) -> None:
        with translated_errors(uri):
            camera().set_bool_property(number, bool(value))

    return Control(ControlInfo(name, ControlKind.SWITCH), read, write)


def _number(ob: Any, uri: str, camera: Callable[[], Any], key: str, name: str) -> Control:
    number = ob.OBPropertyID.__members__[key]
    with translated_errors(uri):
        limits = camera().get_int_property_range(number)

    def read() -> Value:
        with translated_errors(uri):
            return int(camera().get_int_property(number))

    def write(value: Value) -> None:
        step = max(limits.step, 1)
        with translated_errors(uri):
            camera().set_int_property(number, limits.min + step * round((int(value) - limits.min) / step))

    return Control(ControlInfo(name, ControlKind.WHOLE, "", limits.min, limits.max), read, write)


def _sync(uri: str, camera: Callable[[], Any], modes: Mapping[str, Any]) -> Iterator[Control]:
    if len(modes) < 2:
        return

    def read() -> Value:
        with translated_errors(uri):
            mode = camera().get_multi_device_sync_config().mode
        role = next((role for role, names in _SYNC.items() if mode.name in names), None)
        if role is None:
            raise DeviceError(f"{uri}: its synchronisation is {mode.name}, which is none of {', '.join(modes)}")
        return role

    def write(value: Value) -> None:
        with translated_errors(uri):
            config = camera().get_multi_device_sync_config()
            config.mode = modes[str(value)]
            camera().set_multi_device_sync_config(config)

    yield Control(ControlInfo("sync_role", ControlKind.CHOICE, choices=tuple(modes)), read, write)

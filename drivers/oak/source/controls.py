"""Controls of a running OAK."""

from collections.abc import Iterator
from typing import Any

from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.device import DeviceError
from drivers.oak.address import Address
from drivers.oak.range_profile import RangeProfile
from drivers.oak.source.pipelines import Outputs

#: Limits of manual exposure supported by every camera of the family: time [s], and ISO speed over 100.
_EXPOSURE_S = (20e-6, 33e-3)
_GAIN = (1.0, 16.0)


def make(dai: Any, device: Any, outputs: Outputs, address: Address, profile: RangeProfile) -> Controls:
    """The controls: exposure of the cameras, brightness of the projector, range of the time-of-flight camera.

    Controls of the depth cameras have no prefix, those of the colour camera have the prefix `color.`. Changes of the
    range are noted in `profile`.
    """
    controls: list[Control] = []
    for prefix, inputs in outputs.cameras.items():
        controls += _Exposure(dai, [port.createInputQueue() for port in inputs]).controls(prefix)
    if outputs.tof is not None:
        controls.append(_modulation(dai, outputs.tof.createInputQueue(), profile))
    if device.getIrDrivers():
        lights = {"laser_power": device.setIrLaserDotProjectorIntensity, "flood_power": device.setIrFloodLightIntensity}
        for (name, write), first in zip(lights.items(), (address.dots, address.flood)):
            controls.append(_light(name, write, first))
    controls.append(_sync(dai, device, address.sync))
    return Controls(controls)


class _Exposure:
    """Exposure time and gain, which are sent together, and automatic exposure."""

    def __init__(self, dai: Any, queues: list[Any]) -> None:
        self._dai = dai
        self._queues = queues
        self._auto = True
        self._exposure_s, self._gain = 0.01, 1.0

    def controls(self, prefix: str) -> Iterator[Control]:
        number, switch = ControlKind.NUMBER, ControlKind.SWITCH
        yield Control(ControlInfo(f"{prefix}auto_exposure", switch), lambda: self._auto, self._set_auto)
        info = ControlInfo(f"{prefix}exposure_s", number, "s", *_EXPOSURE_S)
        yield Control(info, lambda: self._exposure_s, self._set_exposure)
        yield Control(ControlInfo(f"{prefix}gain", number, "", *_GAIN), lambda: self._gain, self._set_gain)

    def _set_auto(self, value: Value) -> None:
        self._auto = bool(value)
        self._send()

    def _set_exposure(self, value: Value) -> None:
        self._auto, self._exposure_s = False, float(value)
        self._send()

    def _set_gain(self, value: Value) -> None:
        self._auto, self._gain = False, float(value)
        self._send()

    def _send(self) -> None:
        message = self._dai.CameraControl()
        if self._auto:
            message.setAutoExposureEnable()
        else:
            message.setManualExposure(round(self._exposure_s * 1e6), round(self._gain * 100))
        for queue in self._queues:
            queue.send(message)


def _modulation(dai: Any, queue: Any, profile: RangeProfile) -> Control:
    def write(value: Value) -> None:
        config = dai.ToFConfig()
        config.setProfilePreset(getattr(dai.ToFConfig.Profile, f"{str(value).upper()}_RANGE"))
        config.enableOpticalCorrection = True
        queue.send(config)
        profile.change(str(value))

    info = ControlInfo("modulation", ControlKind.CHOICE, choices=("low", "mid", "high"))
    return Control(info, lambda: profile.current, write)


def _sync(dai: Any, device: Any, first: str) -> Control:
    """Synchronisation role; `free` is automatic detection, in which a single device runs free."""
    state = {"role": first}
    roles = dai.ExternalFrameSyncRole
    numbers = {"free": roles.AUTO_DETECT, "master": roles.MASTER, "slave": roles.SLAVE}

    def write(value: Value) -> None:
        if value != state["role"]:
            done, reason = device.setExternalFrameSyncRole(numbers[str(value)])
            if not done:
                raise DeviceError(f"sync_role = {value}: {reason}")
            state["role"] = str(value)

    info = ControlInfo("sync_role", ControlKind.CHOICE, choices=tuple(numbers))
    return Control(info, lambda: state["role"], write)


def _light(name: str, send: Any, first: float) -> Control:
    state = {"share": 0.0}

    def write(value: Value) -> None:
        if not send(float(value)):
            raise DeviceError(f"{name} = {value}: the device has no such light")
        state["share"] = float(value)

    if first > 0:
        write(first)
    return Control(ControlInfo(name, ControlKind.NUMBER, "", 0.0, 1.0), lambda: state["share"], write)

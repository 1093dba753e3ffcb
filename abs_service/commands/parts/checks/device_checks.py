"""Checks of a rig against the streams of its devices or of a recording."""

import time
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

import numpy as np

from abs_service import config
from abs_service.commands.parts.checks.harmless_devices import HARMLESS
from abs_service.config.problems import Problem, allowed_instead
from abs_service.tracker.measurements import measurement
from calib.rig import Noise
from drivers import opening
from drivers.contract.capabilities import StreamInfo
from drivers.contract.device import AddressError
from drivers.contract.frame import Kind


class CheckError(Exception):
    """A configuration that reads well and still cannot work; the message lists every reason."""


def device_streams(rig: config.ServiceConfig, name: str) -> dict[str, list[StreamInfo]]:
    """Streams of a device by sensor; none if it cannot be opened without touching hardware.

    Raises:
        CheckError: it lacks a head that the rig names, or is a recording that cannot be played.
        DeviceError: it cannot be opened.
    """
    uri = rig.devices[name].uri
    scheme = uri.partition(":")[0]
    if scheme not in HARMLESS:
        return {}
    try:
        device = opening.open_device(uri, time.monotonic_ns)
    except AddressError as error:
        hint = "; for a rig that only `abs-service replay FILE` uses, check with --replay FILE"
        raise CheckError(f"{error}{hint if scheme == 'replay' else ''}") from None
    device.close()
    return {
        sensor: _head_streams(device.capabilities.streams, head, sensor) for head, sensor in rig.heads(name).items()
    }


def recorded_streams(rig: config.ServiceConfig, recording: Path) -> dict[str, list[StreamInfo]]:
    """Streams of a recording by the rig's sensors; sensors that are not in it have none.

    Raises:
        DeviceError: it cannot be played.
    """
    device = opening.open_device(f"replay://{quote(str(recording.resolve()))}", time.monotonic_ns)
    device.close()
    return {name: [info for info in device.capabilities.streams if info.sensor == name] for name in rig.sensors}


def check_controls(rig: config.ServiceConfig, name: str) -> None:
    """Refuses controls that a device which can be opened without touching hardware does not take.

    Raises:
        CheckError, ControlError: an unknown control, or a value that it does not take.
    """
    device_table = rig.devices[name]
    if not device_table.controls or device_table.uri.partition(":")[0] not in HARMLESS:
        return
    device = opening.open_device(device_table.uri, time.monotonic_ns)
    device.close()
    infos = {info.name: info for info in device.controls.infos}
    for control, value in device_table.controls.items():
        if control not in infos:
            raise CheckError(f"{control}: no such control, {allowed_instead(control, infos)}")
        infos[control].checked(value)


def check_noises(noises: Mapping[str, Noise], streams: Mapping[str, list[StreamInfo]]) -> None:
    """Refuses noise models of measurements that a device is known not to deliver.

    Raises:
        CheckError: one of them.
    """
    for name, noise in noises.items():
        head = name.partition("/")[0]
        there = {info.stream for info in streams.get(head, [])}
        missing = [kind.value for kind in measurement(noise).frames if kind not in there]
        if there and missing:
            raise CheckError(
                f"{name}: its noise model needs the stream {missing[0]}, {allowed_instead(missing[0], there)}"
            )


def outside(rig: config.ServiceConfig, tracker: str, streams: Mapping[str, list[StreamInfo]]) -> list[Problem]:
    """Pixels of a tracker's region that its depth image, whose size is known, does not have."""
    region, reference = rig.trackers[tracker].region, rig.reference(tracker)[0]
    depth = next((info for info in streams.get(reference, []) if info.kind == Kind.DEPTH), None)
    given = {key: value for key in ("pixel", "seed", "polygon") if (value := getattr(region, key, None)) is not None}
    if depth is None:
        return []
    message = f"lies outside the depth image of {reference}, which has {depth.width} × {depth.height} pixels"
    return [
        Problem(("trackers", tracker, "region", key), message, value)
        for key, value in given.items()
        if np.any(np.min(np.atleast_2d(value), axis=0) >= (depth.width, depth.height))
    ]


def _head_streams(infos: tuple[StreamInfo, ...], head: str, sensor: str) -> list[StreamInfo]:
    streams = [info for info in infos if info.sensor == head]
    if not streams:
        raise CheckError(f'sensor "{sensor}": no head "{head}", {allowed_instead(head, {i.sensor for i in infos})}')
    return streams

"""Validates a configuration and prints what it describes. No device is touched and nothing is started.

  abs-service check                 the simulated demo rig
  abs-service check rig.toml        your own
  abs-service check rig.toml --json the same for scripts
  abs-service check rig.toml --picture first.png    also draws what would be tracked: region, mesh and its rim

The picture needs images: only replay:// and simulated:// devices are opened for it.

Exit code 0 if `abs-service run` could use it, 2 if not.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from abs_service import config, wiring
from abs_service.bus import keys
from abs_service.commands.parts import data_rates, disk, harmless_devices, preview_option, rig_process
from abs_service.commands.parts.harmless_devices import HARMLESS, HarmlessError
from abs_service.commands.parts.preview_option import PictureOptionError
from abs_service.config import plugins
from abs_service.config.problems import allowed_instead
from abs_service.supervision.exit_codes import Exit, is_for_user
from abs_service.tracker.measurements import measurement
from calib.rig import Noise
from drivers import opening
from drivers.contract.capabilities import StreamInfo


class CheckError(Exception):
    """A configuration that reads well and still cannot work; the message lists every reason."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service check`."""
    rig_process.add_config(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    preview_option.add_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Checks one configuration."""
    if arguments.picture:
        preview_option.check(arguments.picture)
    try:
        rig = rig_process.load_config(arguments)
        found = describe(rig, str(arguments.config or "demo.toml"))
        written = _draw_previews(rig, arguments.picture) if arguments.picture else []
    except (config.ConfigError, CheckError, HarmlessError, PictureOptionError) as error:
        if not arguments.json:
            raise
        print(json.dumps({"ok": False, "error": str(error)}, ensure_ascii=False))
        return Exit.USER
    print(json.dumps(found, ensure_ascii=False) if arguments.json else text(found))
    for line in written:
        print(line, file=sys.stderr if arguments.json else sys.stdout)
    return Exit.OK


def describe(rig: config.ServiceConfig, source: str) -> dict[str, Any]:
    """Description of a configuration as plain data.

    Args:
        rig: the configuration.
        source: where it came from.

    Raises:
        CheckError: something that it names does not exist or cannot be made.
    """
    problems: list[str] = []
    streams: dict[str, list[StreamInfo]] = {}
    for name in rig.devices:
        with _noting(f"devices.{name}.uri", problems):
            streams |= _streams(rig, name)
        with _noting(f"devices.{name}.controls", problems):
            _check_controls(rig, name)
    for name, sensor in rig.sensors.items():
        with _noting(f"sensors.{name}.noise", problems):
            if sensor.noise is not None:
                wiring.noise(sensor.noise, sensor.range_m, sensor.no_return)
        with _noting(f"sensors.{name}.texture", problems):
            if sensor.texture is not None:
                wiring.texture(sensor.texture)
    for name, tracker in rig.trackers.items():
        with _noting(f"trackers.{name}", problems):
            wiring.plan(rig, name)
            _check_streams(wiring.noises(rig, name), streams)
        with _noting(f"trackers.{name}.region", problems):
            tracker.region.build()
        with _noting(f"trackers.{name}.template", problems):
            tracker.template.build(tracker.mesh.vertices)
    if problems:
        raise CheckError("\n".join([f"{source}: cannot work", *(f"  {problem}" for problem in problems)]))
    images = data_rates.describe({name: streams.get(name, []) for name in rig.sensors}, rig.record)
    return {
        "ok": True,
        "config": source,
        "rig": rig.name,
        "endpoint": rig.bus.endpoint,
        "calibration": None if rig.calibration is None else rig.calibration.model_dump(mode="json", exclude_none=True),
        "devices": {name: device.uri for name, device in rig.devices.items()},
        "sensors": {name: _sensor(rig, name, streams) for name in rig.sensors},
        "trackers": {name: _tracker(rig, name) for name in rig.trackers},
        "publishes": [keys.key(rig.name, keys.state(name)) for name in rig.trackers],
        "images": images,
        "records": str(rig.record.directory) if rig.record.enabled else None,
        "disk": disk.lasts(rig, 1e6 * images["recorded_mb_s"][1]),
    }


def text(found: dict[str, Any]) -> str:
    """The same for people."""
    lines = [f'{found["config"]} describes rig "{found["rig"]}"', ""]
    if stored := found["calibration"]:
        origin = stored["provenance"]
        lines.append(f"  calibrated by {stored['file']}: {origin['verdict']}, {origin['date']}, {origin['command']}")
    lines += [f"  device   {name}: {uri}" for name, uri in found["devices"].items()]
    for name, sensor in found["sensors"].items():
        streams = ", ".join(sensor["streams"]) or "streams known once it is open"
        texture = f", texture {sensor['texture']}" if sensor["texture"] else ""
        lines.append(f"  sensor   {name}: {streams}; noise {sensor['noise'] or 'unknown, only recorded'}{texture}")
        lines.append(f"           {'':<{len(name)}}  {_camera_text(sensor['camera'])}")
    for name, tracker in found["trackers"].items():
        what = f"{tracker['model']} from {', '.join(tracker['sensors'])}, {tracker['vertices']} vertices"
        how = f"{tracker['objective']}, {tracker['optimizer']}, paced by {tracker['reference']}"
        lines.append(f"  tracker  {name}: {what}; {how}")
    lines += [f"  publishes {key} …" for key in found["publishes"]]
    lines.append(f"  {data_rates.text(found['images'])}")
    lasts = f": {found['disk']}" if found["disk"] else ""
    lines += [
        "",
        f"  applications connect to {found['endpoint']}",
        f"  records to {found['records'] or 'nowhere'}{lasts}",
    ]
    return "\n".join(lines)


def _draw_previews(rig: config.ServiceConfig, path: Path) -> list[str]:
    """Draws what each tracker would track; returns a line about each picture."""
    written: list[str] = []
    for name in rig.trackers:
        with harmless_devices.opened(rig, name) as source:
            written.append(preview_option.draw(rig, name, path, source))
    return written


def _streams(rig: config.ServiceConfig, name: str) -> dict[str, list[StreamInfo]]:
    """Streams of a device by sensor; none if it cannot be opened without touching hardware."""
    uri = rig.devices[name].uri
    scheme = uri.partition(":")[0]
    if scheme not in opening.available():
        raise CheckError(f'"{uri}": no such driver, {allowed_instead(scheme, opening.available())}')
    if scheme not in HARMLESS:
        return {}
    device = opening.open_device(uri, time.monotonic_ns)
    device.close()
    found: dict[str, list[StreamInfo]] = {}
    for head, sensor in rig.heads(name).items():
        streams = [stream for stream in device.capabilities.streams if stream.sensor == head]
        if not streams:
            heads = {stream.sensor for stream in device.capabilities.streams}
            raise CheckError(f'sensor "{sensor}": no head "{head}", {allowed_instead(head, heads)}')
        found[sensor] = streams
    return found


def _check_controls(rig: config.ServiceConfig, name: str) -> None:
    """Refuses controls that a device which can be opened without touching hardware does not take."""
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


def _check_streams(noises: Mapping[str, Noise], streams: Mapping[str, list[StreamInfo]]) -> None:
    """Refuses noise models of what a device is known not to deliver."""
    for name, noise in noises.items():
        head = name.partition("/")[0]
        there = {info.stream for info in streams.get(head, [])}
        missing = [kind.value for kind in measurement(noise).frames if kind not in there]
        if there and missing:
            raise CheckError(
                f"{name}: its noise model needs the stream {missing[0]}, {allowed_instead(missing[0], there)}"
            )


def _sensor(rig: config.ServiceConfig, name: str, streams: dict[str, list[StreamInfo]]) -> dict[str, Any]:
    sensor = rig.sensors[name]
    noise, texture = (None if part is None else plugins.table(part)["type"] for part in (sensor.noise, sensor.texture))
    return {
        "device": sensor.device,
        "streams": [
            f"{one.stream} {one.width}×{one.height} {one.encoding} {one.rate_hz:g} Hz" for one in streams.get(name, [])
        ],
        "camera": _camera(rig, name),
        "noise": noise,
        "texture": texture,
    }


def _camera(rig: config.ServiceConfig, name: str) -> dict[str, str]:
    """Origins of a sensor's intrinsics and pose: a calibration file, this file, or the device."""
    camera, origin = rig.sensors[name].camera, rig.calibration
    found: dict[str, str] = {}
    for part, key in (("projection", "fx"), ("pose", "T_rs")):
        stored = origin is not None and name in origin.sensors and f"camera.{key}" in origin.sensors[name].keys
        given = getattr(camera, key) is not None
        found[part] = origin.file if origin and stored else "configuration" if given else "device"
    return found


def _camera_text(camera: Mapping[str, str]) -> str:
    words = {"configuration": "this file", "device": "the device"}
    projection, pose = (words.get(camera[part], camera[part]) for part in ("projection", "pose"))
    return f"camera from {projection}" if projection == pose else f"projection from {projection}, pose from {pose}"


def _tracker(rig: config.ServiceConfig, name: str) -> dict[str, Any]:
    tracker = rig.trackers[name]
    parts = {
        part: plugins.table(getattr(tracker, part))["type"]
        for part in ("model", "region", "template", "objective", "optimizer")
    }
    reference = "/".join(rig.reference(name))
    return {"sensors": list(tracker.sensors), "reference": reference, "vertices": tracker.mesh.vertices, **parts}


@contextmanager
def _noting(key: str, problems: list[str]) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        if not is_for_user(error):
            raise
        problems.append(f"{key}: {error}")

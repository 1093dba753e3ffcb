"""Validates a configuration and prints its parts. No device is opened, no process is started.

  abs-service check                 the simulated demo rig
  abs-service check rig.toml        your own
  abs-service check rig.toml --json the same for scripts
  abs-service check rig.toml --picture first.png    also draws what would be tracked: region, mesh and its rim
  abs-service check rig.toml --replay take.mcap     as `abs-service replay take.mcap --config rig.toml` would use it

The picture needs images: only replay:// and simulated:// devices are opened for it.

Exit code 0 if `abs-service run` could use it (with --replay, if `abs-service replay` could), 2 if not.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from abs_service import config, wiring
from abs_service.bus import keys
from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import TlsError
from abs_service.commands.parts import disk, preview_option, recorded_rig, rig_process
from abs_service.commands.parts.checks import data_rates, device_checks, harmless_devices
from abs_service.commands.parts.checks.device_checks import CheckError
from abs_service.commands.parts.options import OptionError
from abs_service.config import addresses, plugins
from abs_service.config.positions import located
from abs_service.config.problems import Key, Problem
from abs_service.supervision.exit_codes import Exit, is_for_user
from abs_service.tracking.plan import build_template
from calib.files import limited
from drivers.contract.capabilities import StreamInfo
from drivers.replay import Recording


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service check`."""
    rig_process.add_config(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--replay", metavar="FILE", type=Path, help="check against this recording; the rig's devices do not count"
    )
    preview_option.add_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Checks one configuration."""
    try:
        rig = rig_process.load_config(arguments)
        toml = limited.text(arguments.config) if arguments.config else ""
        found = describe(rig, str(arguments.config or "demo.toml"), toml, arguments.replay)
        written = _draw_previews(rig, arguments) if arguments.picture else []
    except (config.ConfigError, CheckError, OptionError) as error:
        if not arguments.json:
            raise
        print(json.dumps({"ok": False, "error": str(error)}, ensure_ascii=False))
        return Exit.USER
    print(json.dumps(found, ensure_ascii=False) if arguments.json else text(found))
    for line in written:
        print(line, file=sys.stderr if arguments.json else sys.stdout)
    return Exit.OK


def describe(rig: config.ServiceConfig, source: str, toml: str = "", recording: Path | None = None) -> dict[str, Any]:
    """Description of a configuration as plain data.

    Args:
        rig: the configuration.
        source: where it came from.
        toml: the text that it was read from, for the numbers of the lines in messages.
        recording: file whose images take the place of the devices'; None for the devices.

    Raises:
        CheckError: something that it names does not exist or cannot be made.
    """
    problems: list[Problem] = list(addresses.check({name: device.uri for name, device in rig.devices.items()}))
    streams = _streams(rig, recording, problems)
    problems += _unusable_parts(rig, streams)
    if recording and not problems:
        for name in rig.trackers:
            with _noting(("trackers", name, "sensors"), problems):
                recorded_rig.recorded_rig(rig, name, Recording(recording))
    try:
        rig.bus.security(*roles.NAMES).check(rig.bus.endpoint, listens=False)
    except TlsError as error:
        problems.append(Problem(("bus", "tls", error.key), error.problem, error.value))
    if problems:
        lines = located(problems, toml)
        raise CheckError("\n".join([f"{source}: cannot work", *(f"  {line}" for line in lines)]))
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
        "records": str(rig.record.directory.resolve()) if rig.record.enabled else None,
        "disk": disk.lasts(rig, 1e6 * images["recorded_mb_s"][1]),
    }


def _streams(rig: config.ServiceConfig, recording: Path | None, problems: list[Problem]) -> dict[str, list[StreamInfo]]:
    """Streams by sensor, of a recording or of the devices whose addresses have no problem; adds to the problems."""
    streams: dict[str, list[StreamInfo]] = {}
    if recording:
        with _noting(("--replay",), problems):
            streams = device_checks.recorded_streams(rig, recording)
        return streams
    wrong = {problem.key for problem in problems}
    for name in (name for name in rig.devices if ("devices", name, "uri") not in wrong):
        with _noting(("devices", name, "uri"), problems):
            streams |= device_checks.device_streams(rig, name)
        with _noting(("devices", name, "controls"), problems):
            device_checks.check_controls(rig, name)
    return streams


def _unusable_parts(rig: config.ServiceConfig, streams: Mapping[str, list[StreamInfo]]) -> list[Problem]:
    """Problems of sensors and trackers whose parts cannot be made, or that lack a stream."""
    problems: list[Problem] = []
    for name, sensor in rig.sensors.items():
        with _noting(("sensors", name, "noise"), problems):
            if sensor.noise is not None:
                wiring.noise(sensor.noise, sensor.range_m, sensor.no_return)
        with _noting(("sensors", name, "texture"), problems):
            if sensor.texture is not None:
                wiring.texture(sensor.texture)
    for name, tracker in rig.trackers.items():
        with _noting(("trackers", name), problems):
            wiring.plan(rig, name)
            device_checks.check_noises(noises := wiring.noises(rig, name), streams)
            problem = wiring.reference_problem(rig, name, noises)
            problems += [problem] if problem and problem not in problems else []
        with _noting(("trackers", name, "region"), problems):
            tracker.region.build()
        problems += device_checks.outside(rig, name, streams)
        with _noting(("trackers", name, "template"), problems):
            build_template(tracker.template, tracker.mesh.vertices)
    return problems


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
        what = f"{tracker['model']} from {', '.join(tracker['sensors'])}, {_vertices_text(tracker['vertices'])}"
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


def _draw_previews(rig: config.ServiceConfig, arguments: argparse.Namespace) -> list[str]:
    """Draws a preview of each tracker; returns a line about each picture."""
    if arguments.replay:
        return recorded_rig.draw_previews(rig, Recording(arguments.replay), arguments.picture)
    written: list[str] = []
    for name in rig.trackers:
        with harmless_devices.opened(rig, name) as source:
            written.append(preview_option.draw(rig, name, arguments.picture, source))
    return written


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


def _vertices_text(vertices: str | int) -> str:
    return "vertices by its size in the image" if vertices == "auto" else f"{vertices} vertices"


@contextmanager
def _noting(key: Key, problems: list[Problem]) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        if not is_for_user(error):
            raise
        problems.append(Problem(key, str(error)))

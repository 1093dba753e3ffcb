"""Converts calibrations from and to the formats of other programs.

  abs-service calibrate convert camchain.yaml lab.calibration.toml        from Kalibr
  abs-service calibrate convert calib.json lab.calibration.toml --rename cam_a=color --rename cam_b=left
  abs-service calibrate convert left.cameramodel right.cameramodel lab.calibration.toml
  abs-service calibrate convert lab.calibration.toml color.yaml --to ros --sensor color
  abs-service calibrate convert rig.toml rig.urdf                         the frames, for robots

Formats: toml (our calibration and rig files), kalibr (camchain), ros (CameraInfo), opencv (FileStorage as YAML, XML or
JSON), depthai (JSON), mrcal (.cameramodel), and to write only urdf and tf. What a format has no place for is said on
standard error and, with --json, under "lost". What would be wrong is refused, and nothing written (exit code 2): a lens
that a format cannot express, a skew, four coefficients of OpenCV that may be those of two lenses (--lens), cameras more
than 5 m apart (--unit), and fields of view and principal points that no camera has.
"""

import argparse
import json
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from abs_service.bus import keys
from abs_service.calibration.files import exchange, rig_file
from abs_service.commands.calibrate import calibrations
from abs_service.config.problems import allowed_instead
from abs_service.report import provenance
from abs_service.supervision.exit_codes import Exit
from calib.camera import Camera
from calib.files import limited
from calib.formats import opencv, plausibility
from calib.formats.content import Content, Hints
from calib.formats.resizing import resized

#: Metres per unit, as values of `--unit`.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}


class ConvertError(Exception):
    """Options that do not fit the files."""


@dataclass(frozen=True)
class Options:
    """Command-line options.

    Attributes:
        source, target: formats; None to detect them from the files.
        sensors: sensors to write, by their new names; all if empty.
        names: new names by old ones.
        unit: of translations; None if it is the format's.
        hints: values that the input omits; `hints.size` is also the size to convert cameras to.
    """

    source: str | None
    target: str | None
    sensors: tuple[str, ...]
    names: Mapping[str, str]
    unit: str | None
    hints: Hints


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate convert`."""
    parser.add_argument("inputs", metavar="IN", nargs="+", type=Path, help="calibration; several are put together")
    parser.add_argument("out", metavar="OUT", type=Path, help="file to write; must not exist")
    parser.add_argument("--from", dest="source", choices=[exchange.OWN, *exchange.READERS], help="format of IN")
    parser.add_argument("--to", dest="target", choices=[exchange.OWN, *exchange.WRITERS], help="format of OUT")
    parser.add_argument("--sensor", metavar="NAME", action="append", default=[], help="write only this one; repeatable")
    parser.add_argument("--rename", metavar="OLD=NEW", action="append", default=[], help="call it so; repeatable")
    parser.add_argument("--size", metavar="WxH", help="size of the images, if IN does not say it or they have another")
    parser.add_argument(
        "--unit", choices=list(UNITS), help="unit of translations, if IN does not have it (default: its format's, or m)"
    )
    parser.add_argument("--lens", choices=[opencv.BROWN_CONRADY, opencv.FISHEYE], help="kind, if IN leaves it open")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Converts, and reports losses."""
    out = arguments.out
    if out.exists():
        raise ConvertError(f"{out}: exists already; choose another name or remove it")
    hints = Hints(size=_size(arguments.size), lens=arguments.lens or "")
    options = Options(
        arguments.source, arguments.target, tuple(arguments.sensor), _names(arguments.rename), arguments.unit, hints
    )
    read = [_read(path, options) for path in arguments.inputs]
    content = _chosen(read, options)
    target = options.target or exchange.of_name(out)
    lost = [*content.lost, *_write(out, target, content.cameras, arguments)]
    if arguments.json:
        print(json.dumps({"wrote": str(out), "format": target, "sensors": list(content.cameras), "lost": lost}))
        return Exit.OK
    for one in lost:
        print(f"abs-service: lost: {one}", file=sys.stderr)
    print(f"wrote {out}: {', '.join(content.cameras)}")
    for pair, (length, angle) in plausibility.baselines(content.cameras).items():
        print(f"  {pair}: {length * 1e3:.1f} mm apart, turned by {np.rad2deg(angle):.2f}°")
    return Exit.OK


def _read(path: Path, options: Options) -> Content:
    try:
        text = limited.text(path)
    except OSError as error:
        raise ConvertError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConvertError(f"{path}: all formats are UTF-8 text, byte {error.start} is not") from error
    name = options.source or exchange.of_content(path, text)
    if options.hints.lens and name != "opencv":
        raise ConvertError(f"--lens {options.hints.lens}: {path} says itself which lens it has")
    if name == exchange.OWN:
        return _own(path)
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", path.stem).strip("_-") or "camera"
    content = exchange.read(path, text, name, replace(options.hints, name=stem))
    scaled = {key: _scaled(one, UNITS[options.unit or "m"]) for key, one in content.cameras.items()}
    _check(path, scaled, options.unit)
    return replace(content, cameras=scaled)


def _scaled(one: Camera, unit: float) -> Camera:
    """Camera whose translation was in another unit [m]."""
    T_rs = one.T_rs.copy()
    T_rs[:3, 3] *= unit
    return replace(one, T_rs=T_rs)


def _check(path: Path, cameras: Mapping[str, Camera], unit: str | None) -> None:
    """Refuses what no camera of a rig is, unless the unit was given."""
    for doubt in plausibility.doubts(cameras):
        raise ConvertError(f"{path}: {doubt}")
    for pair, (length, _) in plausibility.baselines(cameras).items():
        if length > plausibility.LARGEST_BASELINE_M and unit is None:
            raise ConvertError(
                f"{path}: {pair} are {length:.4g} m apart, if lengths are in metres; say what they are in with --unit, "
                f"one of {', '.join(UNITS)}"
            )


def _own(path: Path) -> Content:
    """Cameras of our own file."""
    known = calibrations.load(path)
    lost = ["the covariances"] if known.covariance.names else []
    for name, sensor in known.sensors.items():
        parts = {
            "depth terms": sensor.depth_offset or sensor.depth_scale,
            "time offset": sensor.time_offset,
            "noise model": sensor.noise,
            "texture": sensor.texture,
            "factory calibration": sensor.factory,
        }
        lost += [f"{name}: {part}" for part, given in parts.items() if given]
    return Content({name: sensor.camera for name, sensor in known.sensors.items()}, tuple(lost))


def _chosen(contents: list[Content], options: Options) -> Content:
    """Selected cameras of all files under their new names and in the requested size."""
    cameras: dict[str, Camera] = {}
    lost: list[str] = []
    for content in contents:
        lost += content.lost
        for name, camera in content.cameras.items():
            new = keys.check_name(options.names.get(name, re.sub(r"[^A-Za-z0-9_-]+", "_", name)))
            if new in cameras:
                raise ConvertError(f'two cameras are called "{new}"; give one another name with --rename')
            cameras[new] = camera
    there = [name for content in contents for name in content.cameras]
    unknown = [name for name in options.names if name not in there]
    if unknown:
        raise ConvertError(f"--rename {unknown[0]}: no such sensor, {allowed_instead(unknown[0], there)}")
    unknown = [name for name in options.sensors if name not in cameras]
    if unknown:
        raise ConvertError(f"--sensor {unknown[0]}: no such sensor, {allowed_instead(unknown[0], cameras)}")
    wanted = options.sensors or tuple(cameras)
    size = options.hints.size
    return Content({name: resized(cameras[name], *size) if size else cameras[name] for name in wanted}, tuple(lost))


def _write(out: Path, target: str, cameras: Mapping[str, Camera], arguments: argparse.Namespace) -> tuple[str, ...]:
    """Writes the file; returns descriptions of what the format cannot hold."""
    if target == exchange.OWN:
        origin = provenance.trace(_command_line(arguments), arguments.inputs)
        sensors = {name: rig_file.SensorCalibration(camera) for name, camera in cameras.items()}
        name = re.sub(r"[^A-Za-z0-9_-]+", "_", out.name.partition(".")[0]) or "rig"
        rig_file.write(rig_file.RigCalibration(name, sensors, origin, "unknown"), out)
        return ()
    written = exchange.write(out, target, cameras)
    try:
        out.write_text(written.text, encoding="utf-8")
    except OSError as error:
        raise ConvertError(f"{out}: cannot be written: {error.strerror}") from error
    return written.lost


def _command_line(arguments: argparse.Namespace) -> list[str]:
    """Command line without options that do not affect the result."""
    options = [("--from", arguments.source), ("--size", arguments.size)]
    options += [("--unit", arguments.unit), ("--lens", arguments.lens)]
    options += [("--sensor", name) for name in arguments.sensor] + [("--rename", pair) for pair in arguments.rename]
    given = [word for option, value in options if value is not None for word in (option, value)]
    return ["calibrate", "convert", *map(str, arguments.inputs), str(arguments.out), *given]


def _size(given: str | None) -> tuple[int, int] | None:
    if given is None:
        return None
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", given)
    if match is None:
        raise ConvertError(f"--size {given}: must be width and height in pixels, such as 640x480")
    return int(match[1]), int(match[2])


def _names(given: list[str]) -> dict[str, str]:
    pairs = [one.partition("=") for one in given]
    wrong = [one for one, (old, _, new) in zip(given, pairs) if not (old and new)]
    if wrong:
        raise ConvertError(f"--rename {wrong[0]}: must be OLD=NEW")
    return {old: new for old, _, new in pairs}

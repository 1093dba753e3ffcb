"""Converts calibrations from and to the formats of other programs.

  abs-service calibrate convert camchain.yaml lab.calibration.toml        from Kalibr
  abs-service calibrate convert calib.json lab.calibration.toml --rename cam_a=color --rename cam_b=left
  abs-service calibrate convert intrinsics.yml extrinsics.yml lab.calibration.toml --size 640x480 --unit mm   OpenCV's
  abs-service calibrate convert left.cameramodel right.cameramodel lab.calibration.toml
  abs-service calibrate convert lab.calibration.toml color.yaml --to ros --sensor color
  abs-service calibrate convert rig.toml rig.urdf                         the frames, for robots

Formats: toml (our calibration and rig files), kalibr (camchain), ros (CameraInfo), opencv (FileStorage as YAML, XML or
JSON), depthai (JSON), mrcal (.cameramodel), colmap (cameras.txt), and to write only urdf and tf. What a format has no
place for is said on standard error and, with --json, under "lost". What would be wrong is refused, and nothing written
(exit code 2): a lens that a format cannot express, a skew, four coefficients of OpenCV that may be those of two lenses
(--lens), cameras more than 5 m apart (--unit), and fields of view and principal points that no camera has.
"""

import argparse
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from abs_service.bus import keys
from abs_service.calibration.files import exchange, rig_file
from abs_service.commands.calibrate.inputs import camera_files
from abs_service.commands.parts.options import OptionError, assignments, check_new, size
from abs_service.config.problems import allowed_instead
from abs_service.report import provenance
from abs_service.supervision.exit_codes import Exit
from calib.camera import Camera
from calib.files import atomic
from calib.formats import opencv, plausibility
from calib.formats.content import Content, Hints
from calib.formats.resizing import resized


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate convert`."""
    parser.add_argument("inputs", metavar="IN", nargs="+", type=Path, help="calibration; several are put together")
    parser.add_argument("out", metavar="OUT", type=Path, help="file to write; must not exist")
    parser.add_argument("--from", dest="source", choices=[exchange.OWN, *exchange.READERS], help="format of IN")
    parser.add_argument("--to", dest="target", choices=[exchange.OWN, *exchange.WRITERS], help="format of OUT")
    parser.add_argument("--sensor", metavar="NAME", action="append", default=[], help="write only this one; repeatable")
    parser.add_argument("--rename", metavar="OLD=NEW", action="append", default=[], help="call it so; repeatable")
    parser.add_argument(
        "--size", metavar="WxH", type=size, help="size of the images, if IN does not say it or they have another"
    )
    help_text = "unit of translations, if IN does not have it (default: its format's, or m)"
    parser.add_argument("--unit", choices=list(camera_files.UNITS), help=help_text)
    parser.add_argument("--lens", choices=[opencv.BROWN_CONRADY, opencv.FISHEYE], help="kind, if IN leaves it open")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Converts, and reports losses."""
    out = arguments.out
    check_new(out)
    hints = Hints(size=arguments.size, lens=arguments.lens or "")
    read = camera_files.read_all(arguments.inputs, hints, arguments.source, arguments.unit)
    content = _chosen(read, arguments)
    target = arguments.target or exchange.of_name(out)
    lost = [*content.lost, *_write(out, target, content.cameras, arguments)]
    if arguments.json:
        print(json.dumps({"wrote": str(out), "format": target, "sensors": list(content.cameras), "lost": lost}))
        return Exit.OK
    for one in lost:
        print(f"abs-service: lost: {one}", file=sys.stderr)
    print(f"wrote {out}: {', '.join(content.cameras)}")
    for pair, how in plausibility.baselines(content.cameras).items():
        first, second = pair.split(", ")
        print(f"  {pair}: {how}, {second} {how.side} {first}")
    for doubt in plausibility.exchanged(content.cameras):
        print(f"abs-service: check: {doubt}", file=sys.stderr)
    return Exit.OK


def _chosen(contents: list[Content], arguments: argparse.Namespace) -> Content:
    """Selected cameras of all files under their new names and in the requested size."""
    names = assignments("--rename OLD=NEW", arguments.rename)
    cameras: dict[str, Camera] = {}
    lost: list[str] = []
    for content in contents:
        lost += content.lost
        for name, camera in content.cameras.items():
            new = keys.check_name(names.get(name, re.sub(r"[^A-Za-z0-9_-]+", "_", name)))
            if new in cameras:
                raise OptionError(f'two cameras are called "{new}"; give one another name with --rename')
            cameras[new] = camera
    there = [name for content in contents for name in content.cameras]
    unknown = [name for name in names if name not in there]
    if unknown:
        raise OptionError(f"--rename {unknown[0]}: no such sensor, {allowed_instead(unknown[0], there)}")
    unknown = [name for name in arguments.sensor if name not in cameras]
    if unknown:
        raise OptionError(f"--sensor {unknown[0]}: no such sensor, {allowed_instead(unknown[0], cameras)}")
    chosen = {name: cameras[name] for name in arguments.sensor or cameras}
    if arguments.size:
        chosen = {name: resized(camera, *arguments.size) for name, camera in chosen.items()}
    return Content(chosen, tuple(lost))


def _write(out: Path, target: str, cameras: Mapping[str, Camera], arguments: argparse.Namespace) -> tuple[str, ...]:
    """Writes the file; returns descriptions of what the format cannot hold."""
    if target == exchange.OWN:
        origin = provenance.trace(arguments.command_line, arguments.inputs)
        sensors = {name: rig_file.SensorCalibration(camera) for name, camera in cameras.items()}
        name = re.sub(r"[^A-Za-z0-9_-]+", "_", out.name.partition(".")[0]) or "rig"
        rig_file.write(rig_file.RigCalibration(name, sensors, origin, "unknown"), out)
        return ()
    written = exchange.write(out, target, cameras)
    try:
        atomic.write(out, written.text)
    except OSError as error:
        raise OptionError(f"{out}: cannot be written: {error.strerror}") from error
    return written.lost

"""Looks whether a stored calibration still holds, in a new recording of a board, and which sensor has moved if not.

  abs-service calibrate verify rig.toml recordings/board.mcap --target board.toml
  abs-service calibrate verify lab.toml --images tof='t-*.png' --images color='c-*.png' --target board.toml
  abs-service calibrate verify rig.toml recordings/board.mcap --target board.toml --json

Exit code 0 if everything is as it was, 1 if something is doubtful, 2 if the calibration should not be used any more or
could not be verified. The report is an HTML page with pictures, and a JSON file beside it.
"""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path

from abs_service.calibration import page, provenance, target_file, verification
from abs_service.calibration.report import Report, to_json
from abs_service.calibration.rig_file import RigCalibration
from abs_service.calibration.seeing import Seen, see
from abs_service.calibration.shot_sources import FolderShots, RecordingShots
from abs_service.calibration.shots import Shot
from abs_service.commands import calibrations
from calib.board.target import Target
from drivers.replay import Recording


class VerifyOptionError(Exception):
    """Options that do not fit together."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate verify`."""
    parser.add_argument("calibration", metavar="RIG_OR_CALIBRATION", type=Path, help="TOML file of either kind")
    parser.add_argument("source", metavar="SOURCE", nargs="?", type=Path, help="recording of the board (.mcap)")
    parser.add_argument(
        "--images", metavar="NAME=GLOB", action="append", default=[], help="images of a sensor in a folder; repeatable"
    )
    parser.add_argument("--target", metavar="FILE", type=Path, required=True, help="description of the board, TOML")
    parser.add_argument("--every", metavar="S", type=float, default=0.5, help="seconds between shots (default: 0.5)")
    parser.add_argument(
        "--report", metavar="PATH", type=Path, help="page to write (default: RIG_OR_CALIBRATION-verify.html)"
    )
    parser.add_argument("--json", action="store_true", help="print the report as one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Verifies, reports and judges."""
    known = calibrations.load(arguments.calibration)
    target = target_file.read(arguments.target)
    shots, files = _source(arguments, known)
    seen = _see(target, shots, known)
    origin = provenance.trace(_said(arguments), [arguments.calibration, arguments.target, *files])
    report = verification.verify(known, seen, origin)
    path = arguments.report or arguments.calibration.with_name(f"{arguments.calibration.stem}-verify.html")
    page_path, _ = page.write(report, path)
    print(json.dumps(to_json(report), ensure_ascii=False) if arguments.json else _text(report, page_path))
    return int(report.level)


def _source(arguments: argparse.Namespace, known: RigCalibration) -> tuple[Iterable[Shot], list[Path]]:
    """The shots, and the files that they come from."""
    if (arguments.source is None) == (not arguments.images):
        raise VerifyOptionError("give either a recording as SOURCE, or --images NAME=GLOB for each sensor")
    if arguments.images:
        patterns = dict(one.partition("=")[::2] for one in arguments.images)
        if not all(patterns.values()):
            raise VerifyOptionError(f"--images {' '.join(arguments.images)}: each must be NAME=GLOB")
        return FolderShots(patterns), [*dict.fromkeys(Path(pattern).parent for pattern in patterns.values())]
    cameras = {name: sensor.camera for name, sensor in known.sensors.items()}
    return RecordingShots(Recording(arguments.source), arguments.every, cameras=cameras), [arguments.source]


def _see(target: Target, shots: Iterable[Shot], known: RigCalibration) -> Seen:
    """What the sensors of the calibration saw of the board; tells on standard error how it goes."""
    cameras = {name: sensor.camera for name, sensor in known.sensors.items()}
    seen = Seen()
    for number, shot in enumerate(shots, start=1):
        seen += see(target, Shot(shot.number, {k: look for k, look in shot.looks.items() if k in cameras}), cameras)
        print(f"\r{number} shots, {len(seen.corners)} images show the board", end="", file=sys.stderr)
    print(file=sys.stderr)
    return seen


def _text(report: Report, path: Path) -> str:
    lines = []
    for verdict in report.verdicts:
        about = f"{verdict.about}: " if verdict.about else ""
        lines.append(f"{verdict.level!s:<9}{about}{verdict.text}")
        lines += [f"{'':<9}{verdict.advice}"] if verdict.advice else []
    return "\n".join([*lines, f"wrote {path}", page.HEADLINES[report.level]])


def _said(arguments: argparse.Namespace) -> list[str]:
    images = [word for one in arguments.images for word in ("--images", one)]
    source = [] if arguments.source is None else [str(arguments.source)]
    given = ["calibrate", "verify", str(arguments.calibration), *source, *images, "--target", str(arguments.target)]
    return [*given, "--every", f"{arguments.every:g}"]

"""Verifies a stored calibration with new views of a board, and identifies a sensor that has moved.

  abs-service calibrate verify rig.toml recordings/board.mcap --target board.toml
  abs-service calibrate verify lab.calibration.toml rig.toml --target board.toml            live, 15 different views
  abs-service calibrate verify lab.toml --images tof='t-*.png' --images color='c-*.png' --target board.toml
  abs-service calibrate verify lab.toml board.corners.npz --target board.toml               corners that capture saved
  abs-service calibrate verify rig.toml recordings/board.mcap --target board.toml --json

Live, hold the board still for a moment, change its pose, hold it still again; it ends after so many views, or with
Ctrl-C: then what was seen until then counts.

Exit code 0 if everything is as it was, 1 if something is doubtful, 2 if the calibration should not be used any more or
could not be verified. The report is an HTML page with pictures, and a JSON file beside it.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from abs_service.calibration.cameras import verification
from abs_service.calibration.files import corner_file, target_file
from abs_service.calibration.files.rig_file import RigCalibration
from abs_service.calibration.shots import image_sizes, unseen
from abs_service.calibration.shots.corner_extraction import BoardObservations, see
from abs_service.calibration.shots.shot_sources import FolderShots, RecordingShots
from abs_service.calibration.shots.shots import Shot
from abs_service.commands.calibrate.inputs import calibrations, live, skipping
from abs_service.commands.calibrate.inputs.material import UnusableImagesError
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.options import OptionError, assignments, check_folder, views
from abs_service.config.problems import allowed_instead
from abs_service.report import page, provenance
from abs_service.report.content import Level, Report, Verdict, to_json
from calib.board.target import Target, has_two_ways_up
from calib.camera import Camera
from calib.solve.start.symmetric_boards import numbered_alike
from drivers.replay import Recording


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate verify`."""
    parser.add_argument("calibration", metavar="RIG_OR_CALIBRATION", type=Path, help="TOML file of either kind")
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="?",
        type=Path,
        help="recording of the board (.mcap), corners (.npz), or rig (.toml): live",
    )
    parser.add_argument(
        "--images", metavar="NAME=GLOB", action="append", default=[], help="images of a sensor in a folder; repeatable"
    )
    parser.add_argument("--target", metavar="FILE", type=Path, required=True, help="description of the board, TOML")
    parser.add_argument(
        "--every",
        metavar="S",
        type=rig_process.seconds,
        default=0.5,
        help="seconds between shots of a recording (default: 0.5)",
    )
    skipping.add_argument(parser)
    parser.add_argument(
        "--shots", metavar="N", type=views, default=15, help="different views to wait for, live (default: 15)"
    )
    parser.add_argument(
        "--report", metavar="PATH", type=Path, help="page to write (default: RIG_OR_CALIBRATION-verify.html)"
    )
    parser.add_argument("--json", action="store_true", help="print the report as one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Verifies, reports and judges."""
    if arguments.report is not None:
        check_folder(arguments.report, "--report")
    path = arguments.report or arguments.calibration.with_name(f"{arguments.calibration.stem}-verify.html")
    page.check_replaceable(path)
    known = calibrations.load(arguments.calibration)
    target = target_file.read(arguments.target)
    seen, files = _look(arguments, target, known)
    if has_two_ways_up(target) and seen.corners:
        cameras = {name: sensor.camera for name, sensor in known.sensors.items()}
        seen = replace(seen, corners=tuple(numbered_alike(seen.corners, cameras)))
    origin = provenance.trace(arguments.command_line, [arguments.calibration, arguments.target, *files])
    try:
        report = verification.verify(known, seen, origin)
    except ValueError as error:
        if type(error).__module__.startswith("calib."):
            failed = Report(f"Verification of {known.name}", origin, (Verdict(Level.BAD, f"{error}."),), ())
            print(f"wrote {page.write(failed, path)[0]}", file=sys.stderr)
        raise
    page_path, _ = page.write(report, path)
    print(json.dumps(to_json(report), ensure_ascii=False) if arguments.json else _text(report, page_path))
    return int(report.level)


def _look(arguments: argparse.Namespace, target: Target, known: RigCalibration) -> tuple[BoardObservations, list[Path]]:
    """Observations of the board, and their source files."""
    if (arguments.source is None) == (not arguments.images):
        raise OptionError("give either a recording or a rig as SOURCE, or --images NAME=GLOB for each sensor")
    cameras = {name: sensor.camera for name, sensor in known.sensors.items()}
    if arguments.images:
        patterns = assignments("--images NAME=GLOB", arguments.images)
        for name, pattern in patterns.items():
            if name not in cameras:
                reason = f"{arguments.calibration} has no such sensor, {allowed_instead(name, cameras)}"
                raise OptionError(f"--images {name}={pattern}: {reason}")
        folders = [*dict.fromkeys(Path(pattern).parent for pattern in patterns.values())]
        return _see_all(arguments, target, FolderShots(patterns), cameras), folders
    if corner_file.is_corner_file(arguments.source):
        return _saved(arguments, target, cameras), [arguments.source]
    if live.is_live(arguments.source):
        return _see_live(arguments, target, cameras), [arguments.source]
    shots = RecordingShots(Recording(arguments.source), arguments.every, cameras=cameras)
    return _see_all(arguments, target, shots, cameras), [arguments.source]


def _saved(arguments: argparse.Namespace, target: Target, cameras: Mapping[str, Camera]) -> BoardObservations:
    """Saved detections, in images of the size that the stored cameras are for."""
    seen = corner_file.read(arguments.source, target)
    for name, size in seen.sizes.items():
        if name in cameras and size != (stored := (cameras[name].width, cameras[name].height)):
            raise OptionError(
                f"{arguments.source}: images of {name} have {size[0]} × {size[1]} pixels, but its camera in "
                f"{arguments.calibration} is for {stored[0]} × {stored[1]}"
            )
    return skipping.kept_of(seen, arguments.skip)


def _see_all(
    arguments: argparse.Namespace, target: Target, shots: Iterable[Shot], cameras: Mapping[str, Camera]
) -> BoardObservations:
    """Observations in all shots, with progress on standard error."""
    seen, shown, progress = BoardObservations(), list[Shot](), ""
    kept = skipping.kept(shots, arguments.skip, arguments.source)
    for number, shot in enumerate(image_sizes.checked_for(kept, cameras, arguments.calibration), start=1):
        shown = unseen.looked_at(shown, shot)
        seen += see(target, _of(cameras, shot), cameras)
        progress = f"{number} shots, {len(seen.corners)} images show the board"
        if sys.stderr.isatty():
            print(f"\r{progress}", end="", file=sys.stderr)
    print("" if sys.stderr.isatty() else progress, file=sys.stderr)
    if shown and not seen.corners:
        raise UnusableImagesError(unseen.reason(target, seen, shown))
    return seen


def _see_live(arguments: argparse.Namespace, target: Target, cameras: Mapping[str, Camera]) -> BoardObservations:
    """Observations in distinct shots of running devices, until sufficient or interrupted by a signal."""
    stop = rig_process.stop_on_signals()
    seen = BoardObservations()
    with live.streaming(arguments.source, cameras, stop.is_set) as (shots, there):
        if not set(there) & set(cameras):
            raise OptionError(
                f"{arguments.source}: {', '.join(there)}: none of its sensors is one of "
                f"{arguments.calibration}: {', '.join(cameras)}"
            )
        kept = skipping.kept(shots, arguments.skip, arguments.source)
        for shot in image_sizes.checked_for(kept, cameras, arguments.calibration):
            new = see(target, _of(cameras, shot), cameras)
            if not live.adds(new, seen):
                continue
            seen += new
            sensors = ", ".join(view.sensor for view in new.corners)
            print(f"{live.views(seen)} of {arguments.shots} views: {sensors}", file=sys.stderr)
            if live.views(seen) >= arguments.shots:
                break
    return seen


def _of(cameras: Mapping[str, Camera], shot: Shot) -> Shot:
    """Shot without the sensors that the calibration does not contain."""
    return Shot(shot.number, {name: look for name, look in shot.sensor_shots.items() if name in cameras})


def _text(report: Report, path: Path) -> str:
    lines = []
    for verdict in report.verdicts:
        about = f"{verdict.about}: " if verdict.about else ""
        lines.append(f"{verdict.level!s:<9}{about}{verdict.text}")
        lines += [f"{'':<9}{verdict.advice}"] if verdict.advice else []
    return "\n".join([*lines, f"wrote {path}", report.wording.headlines[report.level]])

"""Input of `calibrate intrinsics` and `calibrate rig`: detections in images, or saved ones."""

import argparse
import sys
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from abs_service.calibration.files import corner_file, mrcal_corners, target_file
from abs_service.calibration.files.rig_file import SensorCalibration
from abs_service.calibration.shots import corner_extraction, image_sizes, unseen
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.shot_sources import FolderShots, RecordingShots
from abs_service.calibration.shots.shots import Shot
from abs_service.commands.calibrate.inputs import calibrations, live, skipping
from abs_service.commands.parts.options import OptionError, assignments, check_folder, check_new
from abs_service.report import page
from calib.board import coverage
from calib.board.distinct import counts_of, distinct_poses
from calib.board.target import Target
from calib.camera import Camera
from calib.solve.weights import shared
from drivers.replay.recording import Recording


class UnusableImagesError(ValueError):
    """Images that no calibration can come from."""


@dataclass(frozen=True)
class Material:
    """Input of a calibration.

    Attributes:
        seen: observations of boards.
        known: previous calibration, by sensor.
        data: image files.
    """

    seen: BoardObservations
    known: Mapping[str, SensorCalibration]
    data: tuple[Path, ...]


def material(arguments: argparse.Namespace) -> Material:
    """Detects the board in all images, with progress on the terminal.

    Raises:
        OptionError: incompatible options.
        UnusableImagesError: no board, or too few views; the message says why.
        TargetFileError, ShotsError, RecordingError, ConfigError, ReportFileError: files that cannot be used.
        ViewsAlikeError, MirroredSensorError, SameImagesError: the views do not allow a calibration.
    """
    check_new(arguments.out, "--out")
    page.check_replaceable(arguments.out)
    if arguments.corners is not None:
        check_folder(arguments.corners, "--corners")
    if (arguments.source is None or mrcal_corners.is_vnl(arguments.source)) == (not arguments.images):
        raise OptionError("give either a recording or rig as SOURCE, or --images NAME=GLOB for each sensor")
    target = target_file.read(arguments.target)
    known = dict(calibrations.load(arguments.start).sensors) if arguments.start else {}
    source: Path | None = arguments.source
    if source is not None and (corner_file.is_corner_file(source) or mrcal_corners.is_vnl(source)):
        return _checked(skipping.kept_of(_saved(arguments, target, known), arguments.skip), known, (source,))
    with ExitStack() as stack:
        shots, cameras, data = _shots(arguments, {name: each.camera for name, each in known.items()}, stack)
        known = {name: known.get(name, SensorCalibration(camera, factory=camera)) for name, camera in cameras.items()}
        is_live = live.is_live(arguments.source)
        seen, shown = BoardObservations(), list[Shot]()
        for shot in image_sizes.checked(skipping.kept(shots, arguments.skip, arguments.source)):
            shown = unseen.looked_at(shown, shot)
            new = corner_extraction.see(target, shot, cameras)
            if is_live and not live.adds(new, seen):
                continue
            seen += new
            say(f"shot {shot.number}: {unseen.found(new)}")
            if is_live and live.views(seen) >= arguments.shots:
                break
    if shown and not seen.corners:
        raise UnusableImagesError(unseen.reason(target, seen, shown))
    is_seen = len(seen.corners) >= len(seen.rejected)
    if is_seen and (more := unseen.more_than_described(target, shown)):
        raise UnusableImagesError(more)
    corner_file.write(seen, corner_file.path_beside(arguments.out))
    if arguments.corners is not None:
        mrcal_corners.write(seen, target, arguments.corners)
    other = "" if is_seen else unseen.instead(target, shown, seen.rejected.values())
    return _checked(seen, known, data, other)


def _saved(arguments: argparse.Namespace, target: Target, known: Mapping[str, SensorCalibration]) -> BoardObservations:
    """Detections of a file; those of mrcal need names of the pictures and sizes of the images."""
    if corner_file.is_corner_file(arguments.source):
        return corner_file.read(arguments.source, target)
    patterns, given = (
        assignments("--images NAME=GLOB", arguments.images),
        assignments("--size NAME=WxH", arguments.size),
    )
    sizes = {name: (each.camera.width, each.camera.height) for name, each in known.items() if name in patterns}
    for name in patterns:
        width, _, height = given.get(name, "").partition("x")
        if width.isdecimal() and height.isdecimal():
            sizes[name] = (int(width), int(height))
        if name not in sizes:
            raise OptionError(f"--size {name}=WxH: {arguments.source} does not say how large its images are")
    return mrcal_corners.read(arguments.source, target, patterns, sizes)


def _checked(
    seen: BoardObservations, known: Mapping[str, SensorCalibration], data: tuple[Path, ...], other: str = ""
) -> Material:
    """Views that are enough for a calibration, with equal deviations; `other` says what the images may show instead."""
    try:
        coverage.check(view for view in seen.corners)
    except coverage.TooFewViewsError as error:
        unused = f"Not used: {unseen.reasons(seen.rejected.values())}" if seen.rejected else ""
        advice = unseen.STILLS if unseen.mostly_moved(seen) else ""
        raise UnusableImagesError(". ".join(filter(None, (str(error), unused, other, advice)))) from error
    if other:
        say(other)
    for sensor, count in counts_of(seen.corners, distinct_poses(seen.corners, seen.sizes)).items():
        images = sum(view.sensor == sensor for view in seen.corners)
        say(f"{sensor}: {count} distinct poses of the board in {images} images{unseen.unused(sensor, seen)}")
    return Material(replace(seen, corners=tuple(shared(seen.corners))), known, data)


def _shots(
    arguments: argparse.Namespace, cameras: Mapping[str, Camera], stack: ExitStack
) -> tuple[Iterable[Shot], Mapping[str, Camera], tuple[Path, ...]]:
    """Shots, known cameras, and source files."""
    if arguments.images:
        patterns = assignments("--images NAME=GLOB", arguments.images)
        folders = dict.fromkeys(Path(pattern).parent for pattern in patterns.values())
        return FolderShots(patterns), cameras, tuple(folders)
    if not live.is_live(arguments.source):
        recording = Recording(arguments.source)
        known = {**recording.cameras, **cameras}
        return RecordingShots(recording, arguments.every, cameras=known), known, (arguments.source,)
    shots, known = stack.enter_context(live.streaming(arguments.source, cameras))
    return shots, known, (arguments.source,)


def say(text: str) -> None:
    """Prints a progress message."""
    print(f"  {text}", file=sys.stderr)

"""Common parts of `calibrate intrinsics` and `calibrate rig`: sources, options, and everything after the solve."""

import argparse
import itertools
import json
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from abs_service.calibration.cameras import report
from abs_service.calibration.files import rig_file, target_file
from abs_service.calibration.files.rig_file import SensorCalibration
from abs_service.calibration.shots import corner_extraction, unseen
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.shot_sources import FolderShots, RecordingShots
from abs_service.calibration.shots.shots import Shot
from abs_service.commands.calibrate import calibrations, live, skipping
from abs_service.config.problems import allowed_instead
from abs_service.report import page, provenance
from abs_service.report.content import Level, Report, Verdict
from abs_service.supervision.exit_codes import Exit
from calib.board import coverage
from calib.board.distinct import counts_of, distinct_poses
from calib.camera import Camera
from calib.formats.plausibility import baselines
from calib.solve.bundle.lens_parameters import KINDS, kind_of
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.verdict import assess
from calib.solve.weights import shared
from drivers.replay.recording import Recording


class SolveOptionError(ValueError):
    """Options that do not fit the images."""


class UnusableImagesError(ValueError):
    """Images that no calibration can come from."""


@contextmanager
def reported(title: str, arguments: argparse.Namespace) -> Iterator[None]:
    """Reports what the images do not allow; the calibration is not written, and the error goes on."""
    try:
        yield
    except Exception as error:
        if isinstance(error, UnusableImagesError) or type(error).__module__.startswith("calib."):
            data = [path for path in (arguments.source, arguments.target) if path is not None and path.exists()]
            origin = provenance.trace(sys.argv[1:], data)
            made = Report(title, origin, (Verdict(Level.BAD, f"{error}."),), ())
            say(f"wrote {', '.join(map(str, page.write(made, arguments.out)))}")
        raise


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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the common arguments."""
    parser.add_argument(
        "source", metavar="SOURCE", nargs="?", type=Path, help="recording (.mcap), or rig (.toml): live"
    )
    parser.add_argument(
        "--images", metavar="NAME=GLOB", action="append", default=[], help="images of a sensor in a folder; repeatable"
    )
    parser.add_argument("--target", metavar="FILE", type=Path, required=True, help="description of the board, TOML")
    parser.add_argument("--out", metavar="FILE", type=Path, required=True, help="calibration to write; must not exist")
    parser.add_argument("--start", metavar="FILE", type=Path, help="calibration or rig file to start from, or to keep")
    parser.add_argument(
        "--lens", metavar="NAME=KIND", action="append", default=[], help=f"kind of lens: {', '.join(KINDS)}"
    )
    parser.add_argument(
        "--every", metavar="S", type=float, default=0.5, help="least time between shots of a recording (%(default)g)"
    )
    skipping.add_argument(parser)
    parser.add_argument(
        "--shots", metavar="N", type=int, default=30, help="different views to wait for, live (%(default)d)"
    )
    parser.add_argument(
        "--distance", metavar="M", type=float, help="of what will be looked at (default: where the boards were)"
    )
    parser.add_argument(
        "--needed", metavar="PX", type=float, default=1.0, help="how well projections have to be known (%(default)g)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def material(arguments: argparse.Namespace) -> Material:
    """Detects the board in all images, with progress on the terminal.

    Raises:
        SolveOptionError, SkipError: incompatible options.
        UnusableImagesError: no board, or too few views; the message says why.
        TargetFileError, ShotsError, RecordingError, ConfigError: files that cannot be used.
        ViewsAlikeError, MirroredSensorError: the views do not allow a calibration.
    """
    if arguments.out.exists():
        raise SolveOptionError(f"--out {arguments.out}: exists already; choose another name or remove it")
    if (arguments.source is None) == (not arguments.images):
        raise SolveOptionError("give either a recording or rig as SOURCE, or --images NAME=GLOB for each sensor")
    target = target_file.read(arguments.target)
    known = dict(calibrations.load(arguments.start).sensors) if arguments.start else {}
    with ExitStack() as stack:
        shots, cameras, data = _shots(arguments, {name: each.camera for name, each in known.items()}, stack)
        known = {name: known.get(name, SensorCalibration(camera, factory=camera)) for name, camera in cameras.items()}
        is_live = live.is_live(arguments.source)
        seen, shot = BoardObservations(), None
        for shot in skipping.kept(shots, arguments.skip, arguments.source):
            new = corner_extraction.see(target, shot, cameras)
            if is_live and not live.adds(new, seen):
                continue
            seen += new
            say(f"shot {shot.number}: {', '.join(view.sensor for view in new.corners) or 'no board'}")
            if is_live and live.views(seen) >= arguments.shots:
                break
    if shot is not None and not seen.corners:
        raise UnusableImagesError(unseen.reason(target, seen, shot))
    try:
        coverage.check(view for view in seen.corners)
    except coverage.TooFewViewsError as error:
        raise UnusableImagesError(f"{error}. {unseen.STILLS}" if unseen.mostly_moved(seen) else str(error)) from error
    for sensor, count in counts_of(seen.corners, distinct_poses(seen.corners, seen.sizes)).items():
        images = sum(view.sensor == sensor for view in seen.corners)
        say(f"{sensor}: {count} distinct poses of the board in {images} images")
    return Material(replace(seen, corners=tuple(shared(seen.corners))), known, data)


def _shots(
    arguments: argparse.Namespace, cameras: Mapping[str, Camera], stack: ExitStack
) -> tuple[Iterable[Shot], Mapping[str, Camera], tuple[Path, ...]]:
    """Shots, known cameras, and source files."""
    if arguments.images:
        patterns = named(arguments.images, "--images")
        folders = dict.fromkeys(Path(pattern).parent for pattern in patterns.values())
        return FolderShots(patterns), cameras, tuple(folders)
    if not live.is_live(arguments.source):
        recording = Recording(arguments.source)
        known = {**recording.cameras, **cameras}
        return RecordingShots(recording, arguments.every, cameras=known), known, (arguments.source,)
    shots, known = stack.enter_context(live.streaming(arguments.source, cameras))
    return shots, known, (arguments.source,)


def sensor_task(name: str, arguments: argparse.Namespace, found: Material, keeps: bool, **terms: object) -> SensorTask:
    """Task of one sensor, from its image size, previous calibration and options.

    Raises:
        SolveOptionError: fixed intrinsics that are unknown, or no such kind of lens.
    """
    size = found.seen.sizes[name]
    factory = (replace(found.known[name].camera),) if name in found.known else ()
    lenses = named(arguments.lens, "--lens")
    kind = lenses.get(name, kind_of(factory[0].lens).name if factory else "brown-conrady")
    if kind not in KINDS:
        raise SolveOptionError(f"--lens {name}={kind}: {allowed_instead(kind, KINDS)}")
    if factory and name in lenses and kind_of(factory[0].lens).make is not KINDS[kind].make and not keeps:
        factory = ()  # of another lens family: no initial values
    if keeps and not factory:
        raise SolveOptionError(f"{name}: nothing is known of its intrinsics, so they cannot be kept; see --start")
    return SensorTask(*size, KINDS[kind], factory, keeps, **terms)  # pyright: ignore[reportArgumentType]


def finish(title: str, task: Task, arguments: argparse.Namespace, found: Material) -> int:
    """Solves, cross-validates, writes calibration and report, and prints the verdict."""
    solution = calibrate(task, say)
    distance = arguments.distance or _middle_distance(solution.task.reference, solution)
    assessment = assess(solution, distance, arguments.needed, say)
    data = [path for path in (*found.data, arguments.target) if path.exists()]
    origin = provenance.trace(sys.argv[1:], data)
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", arguments.out.name.partition(".")[0]) or "rig"
    made = report.calibration(name, origin, solution, assessment.trusted, found.known)
    notes = [f"{sensor}, shot {shot}: {error}" for (shot, sensor), error in found.seen.rejected.items()]
    result = report.report(title, origin, solution, assessment, notes)
    written = [*rig_file.write(made, arguments.out), *page.write(result, arguments.out)]
    if arguments.json:
        files = [str(path) for path in written]
        print(json.dumps({"trusted": assessment.trusted, "verdict": assessment.verdict, "files": files}))
    else:
        for line in itertools.chain([assessment.verdict], assessment.reasons[1:]):
            print(line)
        for pair, (length, angle) in baselines(solution.cameras).items():
            print(f"{pair}: {length * 1e3:.1f} mm apart, turned by {math.degrees(angle):.2f}°")
        print(f"wrote {', '.join(map(str, written))}")
    return Exit.OK if assessment.trusted else Exit.FAILED


def _middle_distance(reference: str, solution) -> float:
    """Middle of the boards' range of distances from the reference."""
    from calib.solve.validation.projection_uncertainty import reach  # noqa: PLC0415

    return round(math.fsum(reach(solution, reference)) / 2, 2)


def named(options: Iterable[str], option: str) -> dict[str, str]:
    """`NAME=VALUE` options as a table.

    Raises:
        SolveOptionError: one is not of this form.
    """
    found = {}
    for text in options:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise SolveOptionError(f"{option} {text}: must be NAME=VALUE")
        found[name] = value
    return found


def say(text: str) -> None:
    """Prints a progress message."""
    print(f"  {text}", file=sys.stderr)

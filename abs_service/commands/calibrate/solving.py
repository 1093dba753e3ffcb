"""Common parts of `calibrate intrinsics` and `calibrate rig`: sources, options, and everything after the solve."""

import argparse
import itertools
import json
import math
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from abs_service.calibration.cameras import report
from abs_service.calibration.files import rig_file
from abs_service.commands.calibrate.inputs import skipping
from abs_service.commands.calibrate.inputs.material import Material, UnusableImagesError, say
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.options import OptionError, assignments, positive, views
from abs_service.config.problems import allowed_instead
from abs_service.report import page, provenance
from abs_service.report.content import Level, Report, Verdict
from abs_service.supervision.exit_codes import Exit
from calib.calibration_check.kept_intrinsics import with_kept
from calib.formats.plausibility import baselines
from calib.solve.bundle.parameters.lens_parameters import KINDS, LensKind, kind_of
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.start.start import left_out
from calib.solve.validation.verdict import assess


@contextmanager
def reported(title: str, arguments: argparse.Namespace) -> Iterator[None]:
    """Context that writes a report about images that cannot be used, without a calibration, and passes the error on."""
    try:
        yield
    except Exception as error:
        if isinstance(error, UnusableImagesError) or type(error).__module__.startswith("calib."):
            data = [path for path in (arguments.source, arguments.target) if path is not None and path.exists()]
            origin = provenance.trace(arguments.command_line, data)
            made = Report(title, origin, (Verdict(Level.BAD, f"{error}."),), ())
            say(f"wrote {', '.join(map(str, page.write(made, arguments.out)))}")
        raise


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the common arguments."""
    _add_sources(parser)
    parser.add_argument("--out", metavar="FILE", type=Path, required=True, help="calibration to write; must not exist")
    parser.add_argument("--start", metavar="FILE", type=Path, help="calibration or rig file to start from, or to keep")
    parser.add_argument(
        "--lens", type=_lens, metavar="NAME=KIND", action="append", default=[],
        help=f"kind of lens: {', '.join(KINDS)}",
    )  # fmt: skip
    parser.add_argument(
        "--fix", metavar="[NAME=]PARAMETERS", action="append", default=[],
        help="intrinsics that stay as they begin, such as k3,aspect; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--every",
        metavar="S",
        type=rig_process.seconds,
        default=0.5,
        help="least time between shots of a recording (%(default)g)",
    )
    skipping.add_argument(parser)
    parser.add_argument(
        "--half", metavar="SHOTS", type=skipping.numbers, default=frozenset(),
        help="shots of one half of the cross-validation, such as 0-9 (default: every other pose)",
    )  # fmt: skip
    parser.add_argument(
        "--shots", metavar="N", type=views, default=30, help="different views to wait for, live (%(default)d)"
    )
    parser.add_argument(
        "--distance", metavar="M", type=positive, help="of what will be looked at (default: where the boards were)"
    )
    parser.add_argument(
        "--needed",
        metavar="PX",
        type=positive,
        default=1.0,
        help="how well projections have to be known (%(default)g)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _add_sources(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments that say where the corners come from, and of which board."""
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="?",
        type=Path,
        help="recording (.mcap), corners (.npz, .vnl), or rig (.toml): live",
    )
    parser.add_argument(
        "--images", metavar="NAME=GLOB", action="append", default=[], help="images of a sensor in a folder; repeatable"
    )
    parser.add_argument(
        "--size",
        metavar="NAME=WxH",
        action="append",
        default=[],
        help="of its images, for mrcal's corners; repeatable",
    )
    parser.add_argument("--corners", metavar="FILE.vnl", type=Path, help="also write the corners for mrcal")
    parser.add_argument("--target", metavar="FILE", type=Path, required=True, help="description of the board, TOML")


def _lens(text: str) -> str:
    """Type of `--lens`: its kind has to be one."""
    kind = text.rpartition("=")[2]
    if kind not in KINDS:
        raise argparse.ArgumentTypeError(f"{text}: {allowed_instead(kind, KINDS)}")
    return text


def sensor_task(name: str, arguments: argparse.Namespace, found: Material, keeps: bool) -> SensorTask:
    """Task of one sensor, from its image size, previous calibration and options.

    Raises:
        OptionError: fixed intrinsics that are unknown, or a lens of no sensor.
    """
    size = found.seen.sizes[name]
    factory = (found.known[name].camera,) if name in found.known else ()
    lenses = assignments("--lens NAME=KIND", arguments.lens)
    for other in lenses:
        if other not in found.seen.sizes:
            allowed = allowed_instead(other, found.seen.sizes)
            raise OptionError(f"--lens {other}={lenses[other]}: no sensor that saw the board, {allowed}")
    kind = lenses.get(name, kind_of(factory[0].lens).name if factory else "brown-conrady")
    if factory and name in lenses and kind_of(factory[0].lens).make is not KINDS[kind].make and not keeps:
        factory = ()  # of another lens family: no initial values
    if keeps and not factory:
        raise OptionError(f"{name}: nothing is known of its intrinsics, so they cannot be kept; see --start")
    fixed = _fixed(name, arguments.fix, KINDS[kind], found.seen.sizes)
    return SensorTask(*size, KINDS[kind], factory, keeps, fixed=fixed)


def _fixed(name: str, options: Iterable[str], kind: LensKind, sensors: Collection[str]) -> tuple[str, ...]:
    """Intrinsics of a sensor that `--fix` holds where they begin."""
    found: dict[str, None] = {}
    for text in options:
        whose, _, parameters = text.rpartition("=")
        if whose and whose not in sensors:
            raise OptionError(f"--fix {text}: no sensor that saw the board, {allowed_instead(whose, sensors)}")
        for parameter in parameters.split(",") if whose in ("", name) else ():
            if parameter not in kind.fixable:
                raise OptionError(f"--fix {text}: {allowed_instead(parameter, kind.fixable)}")
            found[parameter] = None
    return tuple(found)


def finish(title: str, task: Task, arguments: argparse.Namespace, found: Material) -> int:
    """Solves, cross-validates, writes calibration and report, and prints the verdict."""
    if unknown := sorted(arguments.half - {*task.shots}):
        raise OptionError(f"--half {skipping.text(arguments.half)}: no shot {unknown[0]} shows the board")
    solution = calibrate(task, say)
    distance = arguments.distance or _middle_distance(solution)
    assessment = with_kept(
        assess(solution, distance, arguments.needed, say, arguments.half), solution, arguments.needed
    )
    data = [path for path in (*found.data, arguments.target) if path.exists()]
    origin = provenance.trace(arguments.command_line, data)
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", arguments.out.name.partition(".")[0]) or "rig"
    made = report.calibration(name, origin, solution, assessment.trusted, found.known)
    notes = [f"{sensor}, shot {shot}: {error}" for (shot, sensor), error in found.seen.rejected.items()]
    notes += left_out(task, solution.task)
    result = report.report(title, origin, solution, assessment, notes)
    written = [*rig_file.write(made, arguments.out), *page.write(result, arguments.out)]
    if arguments.json:
        files = [str(path) for path in written]
        print(json.dumps({"trusted": assessment.trusted, "verdict": assessment.verdict, "files": files}))
    else:
        for line in itertools.chain([assessment.verdict], assessment.reasons[1:], report.cameras(solution)):
            print(line)
        for pair, how in baselines(solution.cameras).items():
            first, second = pair.split(", ")
            print(f"{pair}: {how}, {second} {how.side} {first}")
        print(f"wrote {', '.join(map(str, written))}")
    return Exit.OK if assessment.trusted else Exit.FAILED


def _middle_distance(solution: Solution) -> float:
    """Middle of the boards' range of distances from the reference sensor [m]."""
    from calib.solve.validation.projection_uncertainty import reach  # noqa: PLC0415

    return round(math.fsum(reach(solution, solution.task.reference)) / 2, 2)

"""Calibrates a whole rig by bundle adjustment: intrinsics, extrinsics, and errors of depth sensors.

  abs-service calibrate rig take.mcap --target target.toml --out lab.calibration.toml
  abs-service calibrate rig take.mcap --target target.toml --keep tof --depth-terms tof=offset --out l.toml
  abs-service calibrate rig take.mcap --target target.toml --keep color --reference color --fixed-pose depth \
      --depth-terms depth=scale --out l.toml                                                  aligned depth
  abs-service calibrate rig rig.toml --target target.toml --out lab.calibration.toml          live, 30 different views
  abs-service calibrate rig take.corners.npz --target target.toml --skip 7 --fix k3 --out l.toml   again, without images
  abs-service calibrate rig --images left='l*.png' --images right='r*.png' --target target.toml --out p.toml

Corners in colour, infrared and amplitude images and the distances that depth sensors measure on the board are explained
together. Sensors named with --keep keep the intrinsics of the device or of --start, those named with --fixed-pose their
pose to the reference, such as a depth image that the device aligned to its colour image. With --depth-terms an offset,
a scale or both of a sensor's distances are found; with --free-running the offset of its clock, which needs a board that
moves.
Beside the calibration FILE its covariances are written, and a report as FILE.html and FILE.json.

The exit code is 0 if the result can be trusted, 1 if it was found but must not be trusted yet, 2 if the images or
options have to be changed first. What the verdicts mean: docs/how-to/calibration.md.
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace

from abs_service.calibration.files import target_file
from abs_service.commands.calibrate import solving
from abs_service.commands.calibrate.inputs import material
from abs_service.commands.calibrate.inputs.material import Material
from abs_service.commands.parts.options import OptionError, assignments
from abs_service.config.problems import allowed_instead
from calib.board.target import has_two_ways_up
from calib.solve.bundle.tasks import Task

#: Values of `--depth-terms`.
TERMS = {"offset": ("depth_offset",), "scale": ("depth_scale",), "both": ("depth_offset", "depth_scale")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate rig`."""
    solving.add_arguments(parser)
    parser.add_argument("--keep", metavar="NAME", action="append", default=[], help="keep its intrinsics; repeatable")
    parser.add_argument(
        "--fixed-pose", metavar="NAME", action="append", default=[], help="keep its pose to the reference; repeatable"
    )
    parser.add_argument(
        "--depth-terms", metavar="NAME=TERMS", action="append", default=[], help=f"{', '.join(TERMS)}; repeatable"
    )
    parser.add_argument(
        "--free-running", metavar="NAME", action="append", default=[], help="its clock has an offset; repeatable"
    )
    parser.add_argument("--reference", metavar="NAME", help="sensor that stays where it is (default: a depth sensor)")


def run(arguments: argparse.Namespace) -> int:
    """Solves, and reports also what cannot be solved."""
    with solving.reported("Calibration of a rig", arguments):
        return _solve(arguments)


def _solve(arguments: argparse.Namespace) -> int:
    """Solves the rig."""
    found = material.material(arguments)
    seen = {view.sensor for view in (*found.seen.corners, *found.seen.planes)}
    there = [name for name in found.seen.sizes if name in seen]
    terms = assignments("--depth-terms NAME=TERMS", arguments.depth_terms)
    for option, names in (
        ("--keep", arguments.keep),
        ("--fixed-pose", arguments.fixed_pose),
        ("--free-running", arguments.free_running),
        ("--depth-terms", terms),
        ("--reference", [arguments.reference] if arguments.reference else []),
    ):
        _check_names(option, names, there)
    for name, term in terms.items():
        if term not in TERMS:
            raise OptionError(f"--depth-terms {name}={term}: {allowed_instead(term, TERMS)}")
    with_corners = {view.sensor for view in found.seen.corners}
    sensors = {
        name: replace(
            solving.sensor_task(name, arguments, found, keeps=name in arguments.keep or name not in with_corners),
            fixed_pose=name in arguments.fixed_pose,
            depth_terms=TERMS[terms[name]] if name in terms else (),
            free_running=name in arguments.free_running,
        )
        for name in there
    }
    reference = arguments.reference or _reference(found, there, arguments.free_running)
    two_ways_up = has_two_ways_up(target_file.read(arguments.target))
    task = Task(sensors, found.seen.corners, found.seen.planes, reference, two_ways_up=two_ways_up)
    return solving.finish(f"Calibration of {', '.join(there)}", task, arguments, found)


def _check_names(option: str, names: Iterable[str], there: list[str]) -> None:
    for name in names:
        if name not in there:
            raise OptionError(f"{option} {name}: no sensor that saw the board, {allowed_instead(name, there)}")


def _reference(found: Material, there: list[str], free_running: list[str]) -> str:
    """The first depth sensor, as in the built-in rigs, or else the first sensor; free-running ones are excluded."""
    measured = [view.sensor for view in found.seen.planes]
    able = [name for name in there if name not in free_running]
    if not able:
        raise OptionError("--free-running: at least one sensor has to keep the time")
    return next((name for name in able if name in measured), able[0])

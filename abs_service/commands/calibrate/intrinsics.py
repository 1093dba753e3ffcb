"""Calibrates cameras one by one, each in a frame of its own: focal lengths, principal point, lens.

  abs-service calibrate intrinsics take.mcap --target target.toml --out lab.calibration.toml
  abs-service calibrate intrinsics --images color='shots/color_*.png' --target target.toml --out color.calibration.toml
  abs-service calibrate intrinsics --images wide='shots/*.jpg' --lens wide=fisheye --target target.toml --out w.toml

Images are of a recording, of folders, or live of the rig that SOURCE describes. Kinds of lenses: pinhole,
brown-conrady (five coefficients; the default), rational (eight) and fisheye (Kannala and Brandt). Beside the
calibration FILE its covariances are written, and a report as FILE.html and FILE.json.

The exit code is 0 if the result can be trusted, 1 if it was found but must not be trusted yet, 2 if the images or
options have to be changed first. What the verdicts mean: docs/how-to/calibration.md.
"""

import argparse
from dataclasses import replace

from abs_service.commands.calibrate import solving
from abs_service.commands.calibrate.inputs import material
from abs_service.commands.calibrate.inputs.material import Material
from abs_service.commands.parts.options import OptionError
from abs_service.config.problems import allowed_instead
from calib.solve.bundle.tasks import Task


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate intrinsics`."""
    solving.add_arguments(parser)
    parser.add_argument("--sensor", metavar="NAME", help="the sensor (needed if the images are of several)")


def run(arguments: argparse.Namespace) -> int:
    """Solves, and reports also what cannot be solved."""
    with solving.reported("Intrinsics", arguments):
        return _solve(arguments)


def _solve(arguments: argparse.Namespace) -> int:
    """Solves one camera."""
    found = material.material(arguments)
    name = _sensor(arguments.sensor, found)
    task = Task(
        {name: solving.sensor_task(name, arguments, found, keeps=False)},
        [view for view in found.seen.corners if view.sensor == name],
        (),
        name,
    )
    chosen = replace(found, known={each: known for each, known in found.known.items() if each == name})
    return solving.finish(f"Intrinsics of {name}", task, arguments, chosen)


def _sensor(wanted: str | None, found: Material) -> str:
    there = sorted({view.sensor for view in found.seen.corners})
    if wanted is None and len(there) == 1:
        return there[0]
    if wanted not in there:
        why = "boards were seen by several" if wanted is None else "no sensor that saw the board"
        raise OptionError(f"--sensor {wanted or 'NAME'}: {why}, {allowed_instead(wanted or '', there)}")
    return wanted

"""Compares two calibrations of the same cameras, of any format that `convert` reads.

  abs-service calibrate compare lab.calibration.toml left.cameramodel --pair color=left
  abs-service calibrate compare january.calibration.toml march.calibration.toml --corners march.corners.npz

Prints, for every camera that both have, how far their projections differ: a map over the image, and where the largest
difference is. The small motion of the camera that best makes one of the other is subtracted, since a shifted principal
point is nearly a rotation. With the corners from which one was solved, that is done where boards were seen, and the
differences there and elsewhere are given apart: elsewhere a lens is extrapolated. Where ONE or OTHER is a calibration
file with covariances, it says how far two calibrations differ by chance, 95 % of the time. Poses are not compared.
"""

import argparse
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.files import corner_file
from abs_service.calibration.files.rig_file import Covariance
from abs_service.commands.calibrate.inputs import calibrations, camera_files
from abs_service.commands.parts.options import OptionError, assignments, positive, size
from abs_service.config.problems import allowed_instead
from abs_service.supervision.exit_codes import Exit
from calib.camera import Camera
from calib.formats import opencv
from calib.formats.content import Hints
from calib.solve.rounding import rounded
from calib.solve.validation.projection_difference import DifferenceError, DifferenceMap, chance, projection_difference

#: Step between the printed rows and columns of the map.
STEP = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate compare`."""
    parser.add_argument("one", metavar="ONE", type=Path, help="calibration")
    parser.add_argument("other", metavar="OTHER", type=Path, help="calibration of the same cameras")
    parser.add_argument(
        "--pair", metavar="A=B", action="append", default=[], help="camera A of ONE is B of OTHER; repeatable"
    )
    parser.add_argument("--corners", metavar="FILE", type=Path, help="detections of boards (.corners.npz) of ONE")
    parser.add_argument("--distance", metavar="M", type=positive, default=1.0, help="of what is seen (default: 1 m)")
    parser.add_argument("--lens", choices=[opencv.BROWN_CONRADY, opencv.FISHEYE], help="kind, if a file leaves it open")
    parser.add_argument("--size", metavar="WxH", type=size, help="size of the images, if a file does not say it")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Compares, and prints a map of every camera."""
    hints = Hints(size=arguments.size, lens=arguments.lens or "")
    one, other = (camera_files.read(path, hints, unit="m").cameras for path in (arguments.one, arguments.other))
    corners = _corners(arguments.corners)
    found: dict[str, Any] = {}
    for name, its_name in _pairs(arguments, one, other).items():
        if arguments.corners and name not in corners:
            raise OptionError(f"{arguments.corners}: has no corners of {name}, only of {', '.join(corners)}")
        try:
            difference = projection_difference(one[name], other[its_name], arguments.distance, corners.get(name))
        except DifferenceError as error:
            raise OptionError(f"{name}: {error}") from error
        stated = [(arguments.one, name, one[name]), (arguments.other, its_name, other[its_name])]
        by_chance = _chance(stated, arguments.distance, corners.get(name))
        found[name] = _described(difference, by_chance, arguments.corners is not None)
        if not arguments.json:
            _print(f"{name} and {its_name}" if its_name != name else name, found[name], difference)
    if arguments.json:
        print(json.dumps(found))
    return Exit.OK


def _pairs(arguments: argparse.Namespace, one: Mapping[str, Camera], other: Mapping[str, Camera]) -> Mapping[str, str]:
    """Names of the same camera in both."""
    given = assignments("--pair A=B", arguments.pair)
    for name, its_name in given.items():
        for path, chosen, known in ((arguments.one, name, one), (arguments.other, its_name, other)):
            if chosen not in known:
                raise OptionError(f"--pair {name}={its_name}: {path}: {allowed_instead(chosen, known)}")
    if given:
        return given
    if len(one) == len(other) == 1:
        return {next(iter(one)): next(iter(other))}
    if same := [name for name in one if name in other]:
        return {name: name for name in same}
    raise OptionError(
        f"no camera has the same name in both: {', '.join(one)} and {', '.join(other)}; say which is which with --pair"
    )


def _corners(path: Path | None) -> Mapping[str, NDArray[np.float64]]:
    """Pixels (n, 2) of the corners that each sensor has seen; empty without a file."""
    found: dict[str, list[NDArray[np.float64]]] = {}
    for view in corner_file.read_any(path).corners if path else ():
        found.setdefault(view.sensor, []).append(view.pixels)
    return {name: np.concatenate(pixels) for name, pixels in found.items()}


def _chance(
    stated: Iterable[tuple[Path, str, Camera]], distance: float, corners: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Differences by chance, as the calibration files state them (rows, columns) [px]; (1, 1) zeros without."""
    total = np.zeros((1, 1))
    for path, name, camera in stated:
        covariance = calibrations.load(path).covariance if path.suffix == ".toml" else Covariance()
        if own := [k for k, each in enumerate(covariance.names) if each.startswith(f"{name}.")]:
            names = [covariance.names[k].partition(".")[2] for k in own]
            total = np.hypot(total, chance(camera, names, covariance.matrix[np.ix_(own, own)], distance, corners))
    return total


def _described(difference: DifferenceMap, by_chance: NDArray[np.float64], seen: bool) -> dict[str, Any]:
    """The differences of one camera, as JSON."""
    where = {"inside": difference.inside, "outside": ~difference.inside} if seen else {"image": difference.inside}
    parts = {name: difference.summary(mask) for name, mask in where.items()}
    rows = difference.differences.round(4).tolist()
    described: dict[str, Any] = {
        name: part and {"median_px": part[0], "largest_px": part[1], "at": list(part[2])}
        for name, part in parts.items()
    }
    if by_chance.any():
        known = np.isfinite(difference.differences)
        for name, mask in where.items():
            if described[name]:
                place = np.all(difference.pixels == described[name]["at"], axis=2)
                beyond = (difference.differences > by_chance)[mask & known]
                described[name] |= {"chance_px": float(by_chance[place][0]), "beyond": float(beyond.mean())}
    return {**described, "map_px": [[value if np.isfinite(value) else None for value in row] for row in rows]}


_WORDS = {"inside": "where boards were seen", "outside": "elsewhere", "image": "in the whole image"}


def _beyond(part: Mapping[str, Any]) -> str:
    """Clause on chance; "" if nothing is known of it."""
    if "chance_px" not in part:
        return ""
    return (
        f", by chance {rounded(part['chance_px'])} px there (95 %); more than by chance in {part['beyond']:.0%} of it"
    )


def _print(name: str, found: Mapping[str, Any], difference: DifferenceMap) -> None:
    print(f"{name}: difference of the projections")
    for part, words in _WORDS.items():
        if one := found.get(part):
            column, row = one["at"]
            print(
                f"  {words}: median {one['median_px']:.3g} px, "
                f"largest {one['largest_px']:.3g} px at column {column:.0f}, row {row:.0f}{_beyond(one)}"
            )
    pixels, values = difference.pixels[::STEP, ::STEP], difference.differences[::STEP, ::STEP]
    print("  row\\column" + "".join(f"{column:8.0f}" for column in pixels[0, :, 0]))
    for places, row in zip(pixels, values):
        print(f"{places[0, 1]:12.0f}" + "".join(f"{value:8.3f}" if np.isfinite(value) else "       –" for value in row))

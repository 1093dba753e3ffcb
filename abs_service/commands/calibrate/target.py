"""Writes a board to print, true to scale, and the TOML file that describes it to the other commands.

  abs-service calibrate target                                           a ChArUco board for A4: target.pdf, target.toml
  abs-service calibrate target chessboard --paper a3 --out big.svg       big.svg and big.toml
  abs-service calibrate target charuco --columns 12 --rows 8 --square-mm 20 --marker-mm 15
  abs-service calibrate target circles --paper 600x400 --columns 9 --rows 6 --spacing-mm 60 --diameter-mm 30

Print at 100 %, check the ruler below the board, and glue the sheet onto something flat and stiff: glass or aluminium,
not cardboard. If the ruler is not as long as it says, measure some squares and change their length in the TOML file.

charuco             found in parts, cannot be mistaken for its mirror image; needs some 20 pixels per square
chessboard          for small images, down to 5 pixels per square; has to be seen whole
circles             for blurred images; has to be seen whole
asymmetric_circles  the same with one way up
april_grid          Kalibr's; found in parts; needs some 30 pixels per tag
"""

import argparse
import json
from dataclasses import fields, replace
from pathlib import Path

from abs_service.calibration.files import board_sheet, target_file
from abs_service.commands.parts.options import OptionError, check_folder, ending_in, positive, whole
from abs_service.supervision.exit_codes import Exit
from calib.board.april_grid import AprilGrid
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target, outline
from calib.board.target_checks import TargetError

#: Papers by name: width and height, upright [m].
PAPERS = {"a4": (0.210, 0.297), "a3": (0.297, 0.420), "letter": (0.2159, 0.2794)}

#: Default lengths; all fit on A4 and on letter.
DEFAULTS: dict[str, Target] = {
    "charuco": Charuco(9, 6, 0.028, 0.021, "5x5_100"),
    "chessboard": Chessboard(8, 5, 0.028),
    "circles": Circles(9, 6, 0.028, 0.014),
    "asymmetric_circles": AsymmetricCircles(5, 11, 0.016, 0.012),
    "april_grid": AprilGrid(6, 4, 0.032, 0.0096),
}

#: Arguments of the board, with their meaning.
_BOARD = {
    "columns": "inner corners, squares (charuco), discs or tags along the longer side",
    "rows": "along the shorter side",
    "square": "edge of a square",
    "marker": "edge of a marker (charuco)",
    "spacing": "distance of discs",
    "diameter": "of a disc",
    "tag": "edge of a tag (april_grid)",
    "gap": "distance of tags (april_grid)",
}

#: Type of the arguments that count its parts.
_COUNT = whole(1000, "a number", 1)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate target`."""
    parser.add_argument(
        "kind",
        metavar="KIND",
        nargs="?",
        choices=sorted(DEFAULTS),
        default="charuco",
        help="kind of board (%(default)s)",
    )
    for name, meaning in _BOARD.items():
        if name in ("columns", "rows"):
            parser.add_argument(f"--{name}", type=_COUNT, metavar="N", help=meaning)
        else:
            parser.add_argument(f"--{name}-mm", dest=name, type=positive, metavar="MM", help=f"{meaning} [mm]")
    parser.add_argument("--dictionary", metavar="NAME", help="set of markers (charuco; 5x5_100)")
    parser.add_argument(
        "--paper", type=_paper, default=PAPERS["a4"], metavar="SIZE", help="a4, a3, letter or WIDTHxHEIGHT in mm (a4)"
    )
    parser.add_argument(
        "--out", type=ending_in(".pdf", ".svg"), default="target.pdf", metavar="FILE", help=".pdf or .svg (%(default)s)"
    )
    parser.add_argument("--json", action="store_true", help="print what was written as one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Writes the page and the description."""
    check_folder(arguments.out, "--out")
    target = _target(arguments)
    width, height = sorted(arguments.paper, reverse=_is_wide(target))
    page = board_sheet.lay_out(target, width, height, _words(target))
    description = arguments.out.with_suffix(".toml")
    _keep_others(description, target)
    target_file.write(target, description)
    board_sheet.write(page, arguments.out)
    if arguments.json:
        written = {"page": str(arguments.out), "description": str(description), "target": target_file.to_table(target)}
        print(json.dumps(written))
        return Exit.OK
    print(f"{arguments.out}: {_words(target)}, on {width * 1e3:g} × {height * 1e3:g} mm")
    print(f"{description}: its description, for the other commands")
    print("Print at 100 %, check the ruler, glue the sheet onto something flat and stiff.")
    return Exit.OK


def _keep_others(description: Path, target: Target) -> None:
    """Raises OptionError if a file describes another board, or this one with lengths as they were measured."""
    if not description.is_file():
        return
    try:
        is_same = target_file.to_table(target_file.read(description)) == target_file.to_table(target)
    except target_file.TargetFileError:
        is_same = False
    if not is_same:
        raise OptionError(f"{description}: exists and says something else; remove it, or choose another --out")


def _target(arguments: argparse.Namespace) -> Target:
    default = DEFAULTS[arguments.kind]
    allowed = {field.name for field in fields(default)}
    given = {name: getattr(arguments, name) for name in (*_BOARD, "dictionary") if getattr(arguments, name) is not None}
    for name, value in given.items():
        if name not in allowed:
            raise OptionError(f"--{_option(name)} = {value}: means nothing for {arguments.kind}")
    changed = {name: value * 1e-3 if isinstance(value, float) else value for name, value in given.items()}
    # Markers, discs and gaps scale with squares, spacing and tags unless given explicitly.
    for part, one in (("marker", "square"), ("diameter", "spacing"), ("gap", "tag")):
        if one in changed and part in allowed and part not in changed:
            changed[part] = changed[one] * getattr(default, part) / getattr(default, one)
    try:
        return replace(default, **changed)
    except TargetError as error:
        name = str(error).partition(":")[0]
        raise OptionError(f"--{_option(name)}: {str(error).partition(': ')[2]}") from error


def _option(name: str) -> str:
    return name if name in ("columns", "rows", "dictionary") else f"{name}-mm"


def _is_wide(target: Target) -> bool:
    corners = outline(target)
    return bool(corners[2, 0] - corners[0, 0] >= corners[2, 1] - corners[0, 1])


def _words(target: Target) -> str:
    table = target_file.to_table(target)
    size = f"{table.pop('kind').replace('_', ' ')} {table.pop('columns')} × {table.pop('rows')}"
    return ", ".join(
        [size, *(f"{k.removesuffix('_mm')} {v:g} mm" if k.endswith("_mm") else f"{v}" for k, v in table.items())]
    )


def _paper(text: str) -> tuple[float, float]:
    if text.lower() in PAPERS:
        return PAPERS[text.lower()]
    width, _, height = text.lower().partition("x")
    try:
        size = float(width) * 1e-3, float(height) * 1e-3
    except ValueError:
        size = (0.0, 0.0)
    if not all(0.05 <= length <= 5 for length in size):
        raise argparse.ArgumentTypeError(f"{text!r} must be {', '.join(PAPERS)} or a size from 50x50 to 5000x5000 mm")
    return size

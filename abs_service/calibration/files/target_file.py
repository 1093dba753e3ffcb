"""Board description in TOML: `kind = "charuco"`, counts, lengths in metres, or in millimetres as `square_mm`."""

from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

import tomli_w

from abs_service.config.problems import ABSENT, Problem, allowed_instead
from calib.board.april_grid import AprilGrid
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target
from calib.board.target_checks import TargetError
from calib.files import atomic, limited, nested

#: Values of `kind`.
KINDS: Mapping[str, type[Target]] = {
    "chessboard": Chessboard,
    "charuco": Charuco,
    "circles": Circles,
    "asymmetric_circles": AsymmetricCircles,
    "april_grid": AprilGrid,
}

#: Keys of lengths; each may end in `_mm`.
_LENGTHS = ("square", "marker", "spacing", "diameter", "tag", "gap")


class TargetFileError(ValueError):
    """Invalid board description; the message names file, key, value and the allowed values."""


def read(path: Path) -> Target:
    """Reads a board description.

    Raises:
        TargetFileError: unreadable file or invalid description.
    """
    try:
        table = nested.toml(limited.text(path))
    except OSError as error:
        raise TargetFileError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise TargetFileError(f"{path}: is not TOML: {error}") from error
    return from_table(table, str(path))


def from_table(table: Mapping[str, Any], path: str) -> Target:
    """Board of a TOML table; `path` is for error messages.

    Raises:
        TargetFileError: invalid description.
    """
    kind = table.get("kind", ABSENT)
    if kind not in KINDS:
        raise _error(path, Problem(("kind",), f"the kind of board, {allowed_instead(str(kind), KINDS)}", kind))
    Kind = KINDS[kind]
    values = {}
    for key, value in table.items():
        name, in_mm = _name(key)
        if key == "kind":
            continue
        if name not in {field.name for field in fields(Kind)}:
            allowed = ["kind", *to_table(_EXAMPLES[kind]), *(n for n in _LENGTHS if n in Kind.__dataclass_fields__)]
            raise _error(path, Problem((key,), f"unknown key of a {kind}, {allowed_instead(key, set(allowed))}", value))
        if name in values:
            raise _error(path, Problem((key,), f"{name} is given twice, in m and in mm", value))
        checked = _checked(path, key, name, value)
        values[name] = 1e-3 * checked if in_mm else checked
    for field in fields(Kind):
        if field.name not in values and field.default is MISSING:
            shown = f"{field.name}_mm" if field.name in _LENGTHS else field.name
            raise _error(path, Problem((shown,), f"missing, but a {kind} needs it"))
    try:
        return Kind(**values)
    except TargetError as error:
        name, _, message = str(error).partition(": ")
        key = next((key for key in table if _name(key)[0] == name), name)
        raise _error(path, Problem((key,), message, table.get(key, ABSENT))) from error


def to_table(target: Target) -> dict[str, Any]:
    """TOML table of a board, the inverse of `from_table`, in millimetres; what is false or 0 is left out."""
    kind = next(name for name, Kind in KINDS.items() if type(target) is Kind)
    shown = {
        f"{k}_mm" if k in _LENGTHS else k: round(1e3 * v, 6) if k in _LENGTHS else v for k, v in asdict(target).items()
    }
    return {"kind": kind, **{key: value for key, value in shown.items() if value}}


def write(target: Target, path: Path) -> None:
    """Writes the description of a board.

    Raises:
        TargetFileError: the file cannot be written.
    """
    try:
        atomic.write(path, tomli_w.dumps(to_table(target)))
    except OSError as error:
        raise TargetFileError(f"{path}: cannot be written: {error.strerror}") from error


_EXAMPLES: Mapping[str, Target] = {
    "chessboard": Chessboard(9, 6, 0.025),
    "charuco": Charuco(9, 6, 0.03, 0.022, legacy=True, first_id=1),
    "circles": Circles(7, 5, 0.03, 0.015),
    "asymmetric_circles": AsymmetricCircles(4, 11, 0.02, 0.015),
    "april_grid": AprilGrid(6, 6, 0.088, 0.0264),
}


def _name(key: str) -> tuple[str, bool]:
    """Attribute of a key, and True if its value is in millimetres."""
    name = key.removesuffix("_mm")
    return (name, True) if name != key and name in _LENGTHS else (key, False)


def _checked(path: str, key: str, name: str, value: Any) -> Any:
    if name == "dictionary":
        if isinstance(value, str):
            return value
        raise _error(path, Problem((key,), 'must be a name such as "5x5_250"', value))
    if name in _LENGTHS:
        if isinstance(value, int | float) and not isinstance(value, bool):
            return value
        raise _error(path, Problem((key,), "must be a number", value))
    if name == "legacy":
        if isinstance(value, bool):
            return value
        raise _error(path, Problem((key,), "must be true or false", value))
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise _error(path, Problem((key,), "must be a whole number", value))


def _error(path: str, problem: Problem) -> TargetFileError:
    return TargetFileError(f"{path}: {problem}")

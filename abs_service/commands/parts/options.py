"""Values of command-line options: their types, and the error for those that do not fit."""

import argparse
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path

#: The last port that there is.
LAST_PORT = 65535


class OptionError(Exception):
    """Options that do not go together, or do not fit the files that they name; says which, and what is allowed."""


def number(minimum: float, maximum: float, what: str) -> Callable[[str], float]:
    """Type of an argument: a number from `minimum` to `maximum`, described by `what` in the message about others."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not minimum <= value <= maximum:
            raise argparse.ArgumentTypeError(f"{text!r} must be {what}")
        return value

    return read


def whole(maximum: int, what: str, minimum: int = 0) -> Callable[[str], int]:
    """Type of an argument: a whole number from `minimum` to `maximum`, named `what` in the message about others."""

    def read(text: str) -> int:
        is_number = text.isascii() and text.isdigit() and len(text) <= len(str(maximum))
        if not (is_number and minimum <= int(text) <= maximum):
            raise argparse.ArgumentTypeError(f"{text!r} must be {what} from {minimum} to {maximum}")
        return int(text)

    return read


#: Type of an argument: number of a port; 0 lets the system choose one.
port = whole(LAST_PORT, "a port")

#: Type of an argument: how many different views of a calibration board.
views = whole(10_000, "a number of views", 1)

#: Type of an argument: a number that is neither 0 nor infinite.
positive = number(math.ulp(0.0), math.nextafter(math.inf, 0.0), "a number above 0")


def ending_in(*suffixes: str) -> Callable[[str], Path]:
    """Type of an argument: the path of a file in one of the formats that its suffix names."""

    def read(text: str) -> Path:
        if Path(text).suffix not in suffixes:
            raise argparse.ArgumentTypeError(f"{text}: its suffix must be one of {', '.join(suffixes)}")
        return Path(text)

    return read


def check_folder(path: Path, option: str = "") -> None:
    """Checks that there is a folder for a file, which an option names, before the minutes after which it is written.

    Raises:
        OptionError: there is none.
    """
    if not path.parent.is_dir():
        raise OptionError(f"{_named(option, path)}: there is no folder {path.parent}")


def check_new(path: Path, option: str = "") -> Path:
    """Checks that a file can be made, which an option names; returns what it is called until it is complete.

    Raises:
        OptionError: it exists, it exists unfinished, or there is no folder for it.
    """
    if path.exists():
        raise OptionError(f"{_named(option, path)}: exists already; choose another name or remove it")
    check_folder(path, option)
    active = path.with_name(f"{path.name}.active")
    if active.is_file():
        raise OptionError(
            f"{_named(option, path)}: {active} is there, which is being written, or was left unfinished and may be "
            "recovered (`abs-service recover`); choose another name or remove it"
        )
    return active


def _named(option: str, path: Path) -> str:
    return f"{option} {path}".lstrip()


#: Type of an argument: a file that a figure is drawn into.
picture = ending_in(".png", ".svg", ".pdf")


def assignments(option: str, given: Iterable[str]) -> dict[str, str]:
    """Values of an option that may be repeated, by what stands before their `=`.

    Args:
        option: its name and form, such as `--rename OLD=NEW`.
        given: what was given.

    Raises:
        OptionError: something of another form.
    """
    name, form = option.split()
    found = {}
    for text in given:
        key, _, value = text.partition("=")
        if not (key and value):
            raise OptionError(f"{name} {text}: must be {form}")
        found[key] = value
    return found


def size(text: str) -> tuple[int, int]:
    """Type of an argument: width and height [px], such as 640x480."""
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} must be width and height in pixels, such as 640x480")
    return int(match[1]), int(match[2])

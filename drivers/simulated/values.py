"""Parsers of an address's values; they raise a ValueError that names the allowed values."""

import re
from collections.abc import Callable, Iterable
from typing import TypeVar

Number = TypeVar("Number", int, float)

#: Minimum and maximum width and height of images [px].
_MIN_SIZE, _MAX_SIZE = 16, 2048


def number(kind: type[Number], low: float, high: float) -> Callable[[str], Number]:
    """Parser of a number from `low` to `high`."""

    def read(text: str) -> Number:
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise ValueError(f"a number from {low:g} to {high:g}")
        return value

    return read


def one_of(*words: str) -> Callable[[str], str]:
    """Parser of one of several words."""

    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"one of {sorted(words)}")
        return text

    return read


def some_of(words: Iterable[str]) -> Callable[[str], tuple[str, ...]]:
    """Parser of a comma-separated list of distinct words."""
    allowed = sorted(words)

    def read(text: str) -> tuple[str, ...]:
        names = tuple(text.split(","))
        if not set(names) <= set(allowed) or len(set(names)) != len(names):
            raise ValueError(f"one or more of {allowed}, each once")
        return names

    return read


def numbers(most: int, low: float, high: float) -> Callable[[str], tuple[float, ...]]:
    """Parser of up to `most` comma-separated numbers from `low` to `high`."""
    read_one = number(float, low, high)

    def read(text: str) -> tuple[float, ...]:
        parts = text.split(",")
        try:
            found = tuple(map(read_one, parts))
        except ValueError:
            found = ()
        if not 1 <= len(found) <= most:
            raise ValueError(f"1 to {most} numbers from {low:g} to {high:g} with commas in between")
        return found

    return read


def interval(low: float, high: float) -> Callable[[str], tuple[float, float]]:
    """Parser of two comma-separated numbers from `low` to `high`, the second greater than the first."""
    read_some = numbers(2, low, high)

    def read(text: str) -> tuple[float, float]:
        try:
            begin, end = read_some(text)
        except ValueError:
            begin, end = high, low
        if not begin < end:
            raise ValueError(f"two numbers from {low:g} to {high:g} with a comma in between, the second greater")
        return begin, end

    return read


def size(text: str) -> tuple[int, int]:
    """Parses width and height of an image [px], such as 640x480."""
    match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    width, height = (int(number) for number in match.groups()) if match else (0, 0)
    if not (_MIN_SIZE <= width <= _MAX_SIZE and _MIN_SIZE <= height <= _MAX_SIZE):
        raise ValueError(f"WIDTHxHEIGHT, each from {_MIN_SIZE} to {_MAX_SIZE}")
    return width, height

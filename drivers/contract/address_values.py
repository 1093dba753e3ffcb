"""Parsers of an address's values; each raises a ValueError that completes "KEY = TEXT must be …"."""

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

Number = TypeVar("Number", int, float)

_MODE = re.compile(r"([1-9]\d{1,3})x([1-9]\d{1,3})(?:@([1-9]\d{0,2}))?")


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
            raise ValueError(f"one of {', '.join(words)}")
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


def numbers(maximum: int, low: float, high: float) -> Callable[[str], tuple[float, ...]]:
    """Parser of up to `maximum` comma-separated numbers from `low` to `high`."""
    read_one = number(float, low, high)

    def read(text: str) -> tuple[float, ...]:
        parts = text.split(",")
        try:
            found = tuple(map(read_one, parts))
        except ValueError:
            found = ()
        if not 1 <= len(found) <= maximum:
            raise ValueError(f"1 to {maximum} numbers from {low:g} to {high:g} with commas in between")
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


def size(low: int, high: int) -> Callable[[str], tuple[int, int]]:
    """Parser of width and height of an image, each from `low` to `high` [px], such as 640x480."""

    def read(text: str) -> tuple[int, int]:
        match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
        width, height = (int(match[1]), int(match[2])) if match else (0, 0)
        if not (low <= width <= high and low <= height <= high):
            raise ValueError(f"WIDTHxHEIGHT, each from {low} to {high} [px]")
        return width, height

    return read


def mode(text: str, others: str = "") -> tuple[int, int, int]:
    """Parses width, height [px] and rate [Hz] of a stream, such as 640x480@60; the rate is 0 without one.

    Args:
        text: the value.
        others: values that are allowed beside these, for the message.
    """
    match = _MODE.fullmatch(text)
    if match is None:
        raise ValueError(f"{others}a width and a height [px], such as 640x480, with a rate of its own 640x480@60")
    return int(match[1]), int(match[2]), int(match[3] or 0)


def switch(text: str) -> bool:
    """Parses 0 or 1."""
    if text not in ("0", "1"):
        raise ValueError("0 or 1")
    return text == "1"


def file(text: str) -> Path | None:
    """Parses a path; None if there is none."""
    return Path(text) if text else None

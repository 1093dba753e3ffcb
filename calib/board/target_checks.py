"""Checks of the parameters of boards."""

import math

#: Least and largest length of a board [m], and a typical one.
MIN_M, MAX_M, TYPICAL_M = 0.01, 5.0, 0.3


class TargetError(ValueError):
    """Invalid board parameters; the message begins with the wrong attribute."""


def check_counts(columns: int, rows: int, minimum: int) -> None:
    """Checks the numbers of points along both sides."""
    for name, count in (("columns", columns), ("rows", rows)):
        if not minimum <= count <= 100:
            raise TargetError(f"{name}: {count} must be from {minimum} to 100")


def check_length(name: str, length: float) -> None:
    """Checks a length [m]."""
    if not 1e-4 <= length <= 10:
        raise TargetError(
            f"{name}: {length:g} m must be from 0.0001 to 10 m; {name}_mm is in millimetres, {name} in metres"
        )


def check_extent(name: str, spacing: float, count: int) -> None:
    """Checks the longer side of a board, `count` times `spacing` [m], as units are mixed up by powers of ten."""
    extent = count * spacing
    if not MIN_M <= extent <= MAX_M:
        factor = 10.0 ** round(math.log10(TYPICAL_M / extent))
        raise TargetError(
            f"{name}: {spacing:g} m makes the board {extent:g} m long, which must be from {MIN_M:g} to {MAX_M:g} "
            f"m; {name}_mm is in millimetres, {name} in metres. {factor * spacing:g} m would make it "
            f"{factor * extent:g} m"
        )

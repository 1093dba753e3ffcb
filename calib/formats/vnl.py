"""Corners as text in the table that mrcal and mrgingham use, `corners.vnl`: file name, x, y and level or weight."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_COLUMNS = ("filename", "x", "y")


class VnlError(ValueError):
    """Text that is not such a table; the message names the line."""


def write(pictures: Mapping[str, NDArray[np.float64]]) -> str:
    """Table of the points (n, 2) [px] of each picture by its name, row by row of the board; NaN for missing ones."""
    lines = ["# filename x y level"]
    for name, points in pictures.items():
        lines += [f"{name} - - -" if np.isnan(u) else f"{name} {u:.6f} {v:.6f} 0" for u, v in points.tolist()]
    return "\n".join(lines) + "\n"


def read(text: str) -> dict[str, NDArray[np.float64]]:
    """Points (n, 2) [px] of each picture, by its file name; NaN where a point is missing or ignored.

    Points of a negative level, or without weight, are ignored, as by mrcal.

    Raises:
        VnlError: no legend, or a line that does not fit it.
    """
    columns: list[str] = []
    found: dict[str, list[tuple[float, float]]] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("#") or not line.strip():
            if not columns and not line.startswith(("##", "#!")) and line[1:].split()[:3] == [*_COLUMNS]:
                columns = line[1:].split()
            continue
        fields = line.split()
        if not columns or len(fields) > len(columns) or len(fields) < len(_COLUMNS):
            raise VnlError(f"line {number}: must be {', '.join(columns or _COLUMNS)}, as the legend says")
        try:
            found.setdefault(fields[0], []).append(_point(dict(zip(columns, fields, strict=False))))
        except ValueError as error:
            raise VnlError(f"line {number}: {line!r} must have numbers, or - for a missing point") from error
    if not columns:
        raise VnlError("has no legend: # filename x y level")
    return {name: np.array(points) for name, points in found.items()}


def _point(row: Mapping[str, str]) -> tuple[float, float]:
    level, weight = row.get("level", "0"), row.get("weight", "1")
    is_missing = "-" in (row["x"], row["y"], level, weight) or float(level) < 0 or float(weight) <= 0
    return (np.nan, np.nan) if is_missing else (float(row["x"]), float(row["y"]))

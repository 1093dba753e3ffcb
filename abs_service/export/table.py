"""Estimates as a table: one row each, Θ and its σ in columns."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from abs_service.api.estimate import Estimate

Cell = float | int | str | None

#: Columns before those of Θ and its σ.
COLUMNS = ("time_s", "status", "mesh_version", "inlier_share", "deviation_m", "evaluations", "reasons")


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes a CSV file and returns its number of rows; a cell is empty where there is no value.

    Raises:
        OSError: the file cannot be written.
    """
    names, found = rows(estimates)
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(names)
        table.writerows(found)
    return len(found)


def rows(estimates: Iterable[Estimate]) -> tuple[list[str], list[list[Cell]]]:
    """Names of the columns, and a row for each estimate.

    A cell is None where there is no value: Θ and σ before an object is found, σ while it is LOST. `deviation_m` is the
    standard deviation of a vertex's position, median over the mesh.
    """
    found, size = [], 0
    for one in estimates:
        sigma = np.sqrt(np.diag(one.covariance))
        reasons = "; ".join(one.reasons)
        first = (one.time_s, one.status.value, one.mesh_version, one.inlier_share, deviation_m(one), one.evaluations)
        found.append(((*first, reasons), one.theta, sigma))
        size = max(size, len(one.theta))
    names = [*COLUMNS, *(f"theta_{i}" for i in range(size)), *(f"sigma_{i}" for i in range(size))]
    gaps = ([None] * (size - len(theta)) for _, theta, _ in found)
    return names, [
        list(map(_cell, [*first, *theta.tolist(), *gap, *sigma.tolist(), *gap]))
        for (first, theta, sigma), gap in zip(found, gaps)
    ]


def deviation_m(estimate: Estimate) -> float:
    """Standard deviation of a vertex's position, median over the mesh [m]; NaN without a mesh."""
    variances = np.trace(estimate.vertex_covariance, axis1=1, axis2=2)
    return float(np.sqrt(np.median(variances))) if len(variances) else float("nan")


def _cell(value: Cell) -> Cell:
    return None if isinstance(value, float) and np.isnan(value) else value

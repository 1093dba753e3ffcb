"""Estimates as a table: one row each, Θ and its σ in columns."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from abs_service.api.estimate import Estimate

#: Columns before those of Θ and its σ.
COLUMNS = ("time_s", "status", "mesh_version", "inlier_share", "deviation_m", "evaluations", "reasons")


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes a CSV file and returns its number of rows.

    A cell is empty where there is no value: Θ and σ before an object is found, σ while it is LOST. `deviation_m` is the
    standard deviation of a vertex's position, median over the mesh.

    Raises:
        OSError: the file cannot be written.
    """
    rows, size = [], 0
    for one in estimates:
        sigma = np.sqrt(np.diag(one.covariance))
        reasons = "; ".join(one.reasons)
        first = (one.time_s, one.status.value, one.mesh_version, one.inlier_share, _deviation_m(one), one.evaluations)
        rows.append(((*first, reasons), one.theta, sigma))
        size = max(size, len(one.theta))
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow([*COLUMNS, *(f"theta_{i}" for i in range(size)), *(f"sigma_{i}" for i in range(size))])
        for first, theta, sigma in rows:
            gap = [""] * (size - len(theta))
            table.writerow(map(_cell, [*first, *theta.tolist(), *gap, *sigma.tolist(), *gap]))
    return len(rows)


def _deviation_m(estimate: Estimate) -> float:
    variances = np.trace(estimate.vertex_covariance, axis1=1, axis2=2)
    return float(np.sqrt(np.median(variances))) if len(variances) else float("nan")


def _cell(value: object) -> object:
    return "" if isinstance(value, float) and np.isnan(value) else value

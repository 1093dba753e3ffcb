"""Variance components: how much larger the errors of groups of measurements are than their stated deviations say."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle import robust
from calib.solve.bundle.blocks import Planes
from calib.solve.bundle.equations import Equations, Group


def rescale(equations: Equations, factors: tuple[float, ...]) -> Equations:
    """Equations with the deviations of every group scaled."""
    groups = [group.rescaled(factor) for group, factor in zip(equations.groups, factors, strict=True)]
    return replace(equations, groups=groups)


def covariance_inflation(equations: Equations, residuals: NDArray[np.float64]) -> float:
    """Inflation of the covariance by the robust loss: mean over the groups, each scaled to unit deviation."""
    unit = []
    for rows in equations.slices():
        own = residuals[rows]
        unit.append(own / max(robust.scale(own, own.size), 1e-12))
    return robust.covariance_inflation(np.concatenate(unit))


def correlation_inflation(group: Group, residuals: NDArray[np.float64]) -> float:
    """Inflation of the deviation by errors that the distances of a view have in common.

    Errors of neighbouring pixels of a depth sensor are correlated, so a thousand distances carry less information than
    a thousand independent ones. The inflation follows from the scatter of the views' means.
    """
    if not isinstance(group.measured, Planes):
        return 1.0
    views = group.views_of_rows
    counts = np.bincount(views)
    unit = residuals / max(float(np.sqrt(np.mean(residuals**2))), 1e-12)
    clipped = np.clip(unit, -robust.OUTLIER, robust.OUTLIER)
    excess = float(np.mean(np.bincount(views, clipped) ** 2 / np.maximum(counts, 1)))
    chance = 1 + 3 * np.sqrt(2 / len(counts))
    return float(np.sqrt(excess)) if excess > chance else 1.0

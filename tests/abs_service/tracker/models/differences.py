"""Central differences, which closed-form derivatives are compared with."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel

#: Surface motion [m]: large against the rounding of 32-bit vertices, small against their curvature.
STEP_M = 1e-3


def central_differences(model: DeformationModel, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 3, dim) of a model's vertices at theta (dim,), from 2 dim deformed meshes."""
    steps = STEP_M * model.scales
    offsets = np.diag(steps)
    vertices = model.deform(np.concatenate([theta + offsets, theta - offsets])).vertices.astype(np.float64)
    plus, minus = vertices[: len(steps)], vertices[len(steps) :]
    return np.asarray((plus - minus) / (2 * steps)[:, None, None], np.float64).transpose(2, 1, 0)


def change(
    points: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    theta: NDArray[np.float64],
    direction: NDArray[np.float64],
    step: float,
) -> NDArray[np.float64]:
    """Derivative (n, 3) of points (n, 3), in double precision, at theta along a direction, both (dim,)."""
    return (points(theta + step * direction) - points(theta - step * direction)) / (2 * step)

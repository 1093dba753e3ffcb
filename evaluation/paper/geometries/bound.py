"""Cramér–Rao bound of the control points in one frame, from the renderer alone.

Near the truth Θ, distances and grey values change by J δΘ, with J the finite differences of two renderings, and their
noise has the true σ of each pixel; so no unbiased estimate of Θ has a smaller covariance than (Jᵀ σ⁻² J)⁻¹. The
information of the priors is added: Jₛᵀ Jₛ of the relative edge lengths over their deviation, and
1 / (speed · interval)² of every parameter. The prediction of the motion prior is taken as exact up to that; the further
gain of a filter with the covariance of its prediction is not included. Pixels at the rim, which mix the sheet with the
background, are left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.paper.geometries.known_sheet import KnownSheet
from evaluation.scenes.printed_sheet import GREY_DEVIATION, RATE_HZ, PrintedSheet
from evaluation.scenes.surfaces import SplineSurface
from evaluation.scenes.time_of_flight import SR4000

#: Step of the differences [m], large against the few micrometres of rendering error.
STEP_M = 5e-4

#: Minimum share of a pixel covered by the sheet.
COVERED = 0.999

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Priors:
    """Deviations of the priors: of an edge's relative length, and of a parameter's speed [m/s]."""

    stretch: float
    speed: float


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """Root mean square errors [mm] of the control points and of the surface along its normal.

    Attributes:
        full: bound from all pixels and the priors.
        sensors: bound from the pixels with vertices, without priors.
        posterior: the same with the priors.
        euclidean: expected error of least squares with one deviation for all distances, with the priors.
        bias: error that the stretch prior causes beside the posterior's, because the true sheet stretches a little.
        pixels: number of the pixels with vertices.
    """

    full: tuple[float, float]
    sensors: tuple[float, float]
    posterior: tuple[float, float]
    euclidean: tuple[float, float]
    bias: tuple[float, float]
    pixels: int


@dataclass(frozen=True, slots=True, eq=False)
class Derivatives:
    """Derivatives of the images with respect to the control points, in pixels fully covered by the sheet.

    Attributes:
        inner: such pixels (height, width).
        distance, grey: derivatives (pixels, 48), by metre.
        deviation: true σ of the distances (pixels,) [m].
    """

    inner: NDArray[np.bool_]
    distance: Array
    grey: Array
    deviation: Array


def derivatives(scene: PrintedSheet, control: Array) -> Derivatives:
    """Derivatives by differences of renderings around true control points (4, 4, 3)."""
    view = scene.view(control)
    inner = view.share > COVERED
    distance, grey = [], []
    for parameter in range(control.size):
        moved = control.copy()
        moved.ravel()[parameter] += STEP_M
        other = scene.view(moved)
        inner &= other.share > COVERED
        distance.append((other.distance - view.distance) / STEP_M)
        grey.append((other.color[..., 0] - view.color[..., 0]) / STEP_M)
    by_distance, by_grey = (np.stack([one[inner] for one in part], axis=1) for part in (distance, grey))
    deviation = scene.sensor.deviation(view.distance, scene.sensor.amplitude(view))[inner]
    return Derivatives(inner, by_distance, by_grey, deviation)


def bound(control: Array, known: KnownSheet, priors: Priors, found: Derivatives, mean: float) -> Bound:
    """Bounds at true control points (4, 4, 3).

    Args:
        control: true control points.
        known: the sheet that is tracked.
        priors: their deviations.
        found: derivatives of the images.
        mean: deviation that the Euclidean fitness has for all [m].
    """
    read = _read(control, known, found.inner)
    J, G, sigma = found.distance[read], found.grey[read] / GREY_DEVIATION, found.deviation[read, None]
    images = _information(found, np.ones_like(read)), _information(found, read)
    stretches, residual = edges(control, known, priors.stretch)
    prior = stretches.T @ stretches + np.eye(control.size) * (RATE_HZ / priors.speed) ** 2
    posterior = np.linalg.inv(images[1] + prior)
    squares = np.linalg.inv(J.T @ J / mean**2 + G.T @ G + prior)
    scatter = (J * sigma).T @ (J * sigma) / mean**4 + G.T @ G
    bias = posterior @ (stretches.T @ residual)
    return Bound(
        full=_errors_mm(control, np.linalg.inv(images[0] + prior)),
        sensors=_errors_mm(control, np.linalg.inv(images[1])),
        posterior=_errors_mm(control, posterior),
        euclidean=_errors_mm(control, squares @ (scatter + prior) @ squares),
        bias=_errors_mm(control, np.outer(bias, bias)),
        pixels=int(read.sum()),
    )


def _information(found: Derivatives, pixels: NDArray[np.bool_]) -> Array:
    """Fisher information of some pixels on the control points (48, 48)."""
    rows = np.concatenate([found.distance / found.deviation[:, None], found.grey / GREY_DEVIATION], axis=1)
    J, G = np.split(rows[pixels], 2, axis=1)
    return J.T @ J + G.T @ G


def _read(control: Array, known: KnownSheet, inner: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask (k,) of the inner pixels with a vertex."""
    points = SplineSurface((4, 4), 2, *known.places).points(control).reshape(-1, 3)
    u, v = np.floor(SR4000.project(points) + 0.5).astype(int).T
    hit = np.zeros(inner.shape, bool)
    inside = (u >= 0) & (u < SR4000.width) & (v >= 0) & (v < SR4000.height)
    hit[v[inside], u[inside]] = True
    return hit[inner]


def edges(control: Array, known: KnownSheet, deviation: float) -> tuple[Array, Array]:
    """Derivatives (edges, 48) and values (edges,) of the edges' relative changes of length over their deviation."""
    surface = SplineSurface((4, 4), 2, *known.places)
    basis = np.stack([surface.points(one).reshape(-1, 3)[:, 0] for one in _units(control)], axis=1)
    sides = np.concatenate([known.faces[:, [0, 1]], known.faces[:, [1, 2]], known.faces[:, [2, 0]]])
    i, j = np.unique(np.sort(sides, axis=1), axis=0).T
    difference = basis[i] - basis[j]
    rest = np.linalg.norm(difference @ known.control.reshape(-1, 3), axis=1)
    along = difference @ control.reshape(-1, 3)
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    rows = (difference[:, :, None] * unit[:, None, :]).reshape(len(i), -1)
    return rows / rest[:, None] / deviation, (length / rest - 1) / deviation


def _units(control: Array) -> Array:
    """Control points that are 1 at one place (16, 4, 4, 3): their surfaces are the base splines."""
    count = control.size // 3
    return np.eye(count).reshape(count, *control.shape[:2], 1) * np.ones(3)


def _errors_mm(control: Array, covariance: NDArray[np.floating]) -> tuple[float, float]:
    """Root mean square errors of control points and of the surface along its normal [mm]."""
    basis, normal = surface_frame(control)
    rows = (basis[:, :, None] * normal[:, None, :]).reshape(len(basis), -1)
    surface = np.einsum("ki,ij,kj->k", rows, covariance, rows).mean()
    return float(np.sqrt(3 * np.trace(covariance) / control.size) * 1e3), float(np.sqrt(surface) * 1e3)


def surface_frame(control: Array) -> tuple[Array, Array]:
    """Base splines (k, 16) and unit normals (k, 3) at places all over a surface of control points (4, 4, 3)."""
    surface = SplineSurface((4, 4), 2, np.linspace(0, 1, 21), np.linspace(0, 1, 28))
    basis = np.stack([surface.points(one)[..., 0].ravel() for one in _units(control)], axis=1)
    along_u, along_w = np.gradient(surface.points(control), axis=(0, 1))
    normal = np.cross(along_u, along_w).reshape(-1, 3)
    return basis, normal / np.linalg.norm(normal, axis=1, keepdims=True)

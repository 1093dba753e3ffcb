"""Binding of a mesh to a NURBS surface: fit of the rest surface, closest points and offsets of the vertices."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import ModelError
from abs_service.tracker.models.parts import spline

#: Largest distance [m] between a vertex and the normal of its closest surface point; the vertex moves onto the normal.
BINDING_TOLERANCE_M = 1e-2

#: Largest share of a mesh's area, seen on its chart, that may lie behind the rest of it.
MAX_FOLD = 0.02

#: Factors of the rest surface's smoothing, tried in turn until every vertex has a normal. One that follows a limb or a
#: step closely is bent so much there that its normals miss vertices; a smoother one leaves more to their offsets.
_SMOOTHER = (1.0, 10.0, 100.0)


def check_chart(mesh: Mesh) -> None:
    """Checks that a mesh can be flattened onto its chart.

    Raises:
        ModelError: parts of the mesh lie on top of each other there.
    """
    signed = _chart_areas(mesh)
    backwards = min(np.sum(signed[signed > 0]), -np.sum(signed[signed < 0])) / np.sum(np.abs(signed))
    if backwards > MAX_FOLD:
        raise ModelError(
            f"nurbs is a surface with one side, like a sheet or a relief: {backwards:.0%} of the mesh's area lies "
            f"behind the rest, seen along its shortest axis ({MAX_FOLD:.0%} allowed); rigid follows a closed body"
        )


def chart_parameters(mesh: Mesh, margin: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Surface parameters (n,) of the vertices: u along the chart's first axis; N̂ is oriented like their normals."""
    low, size = mesh.chart.min(axis=0), np.ptp(mesh.chart, axis=0)
    u, w = ((mesh.chart - low) / size * (1 - 2 * margin) + margin).T
    return (u, w) if np.sum(_chart_areas(mesh)) > 0 else (u, 1 - w)


def _chart_areas(mesh: Mesh) -> NDArray[np.float64]:
    """Signed areas (m,) of the faces on the chart, twice."""
    chart = mesh.chart[mesh.faces]
    (a, b), (c, d) = (chart[:, 1] - chart[:, 0]).T, (chart[:, 2] - chart[:, 0]).T
    return a * d - b * c


def fit_control_points(
    vertices: NDArray[np.float64],
    u: NDArray[np.float64],
    w: NDArray[np.float64],
    weights: NDArray[np.float64],
    degree: int,
    smoothing: float,
) -> NDArray[np.float64]:
    """Control points (rows, columns, 3) that minimise the squared distances plus a bending penalty.

    Args:
        vertices: positions (n, 3) [m].
        u, w: surface parameters (n,) of the vertices.
        weights: weights of the control points (rows, columns).
        degree: degree of the surface.
        smoothing: weight of the squared second differences of the control points.
    """
    rows, columns = weights.shape
    basis = spline.rational_basis(u, w, degree, weights)[0]
    bend_u = np.kron(np.diff(np.eye(rows), 2, axis=0), np.eye(columns))
    bend_w = np.kron(np.eye(rows), np.diff(np.eye(columns), 2, axis=0))
    bending = np.concatenate([bend_u, bend_w]) * np.sqrt(smoothing * len(vertices) / (rows * columns))
    system = np.concatenate([basis, bending])
    target = np.concatenate([vertices, np.zeros((len(bending), 3))])
    solution = np.linalg.lstsq(system, target, rcond=None)[0]
    return np.asarray(solution, np.float64).reshape(rows, columns, 3)


def fit_and_bind(
    mesh: Mesh, weights: NDArray[np.float64], degree: int, margin: float, smoothing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Control points (rows, columns, 3) of the rest surface, and u, w and offset, each (n,), of the vertices on it.

    Args:
        mesh: mesh with a chart.
        weights: weights of the control points (rows, columns).
        degree: degree of the surface.
        margin: share of the mesh's size by which the surface extends beyond it on every side.
        smoothing: weight of the bending of the rest surface, the least: it is smoother where that is needed to bind.

    Raises:
        ModelError: a vertex is far from every normal of even the smoothest surface; the message is of the first.
    """
    start = chart_parameters(mesh, margin)
    refused: list[ModelError] = []
    for factor in _SMOOTHER:
        control = fit_control_points(mesh.vertices, *start, weights, degree, factor * smoothing)
        try:
            return control, *bind(mesh.vertices, control, weights, degree, *start)
        except ModelError as error:
            refused.append(error)
    raise refused[0]


def bind(
    vertices: NDArray[np.float64],
    control: NDArray[np.float64],
    weights: NDArray[np.float64],
    degree: int,
    u: NDArray[np.float64],
    w: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Closest surface point (u, w) (eq. 6) and offset o along the normal there [m] (eq. 7), each (n,).

    Args:
        vertices: positions (n, 3) [m].
        control: control points (rows, columns, 3) [m].
        weights: their weights (rows, columns).
        degree: degree of the surface.
        u, w: start values (n,) in [0, 1].

    Raises:
        ModelError: a vertex is far from the normal of its closest point: at the surface's edge, or where it folds.
    """
    points = control.reshape(-1, 3)
    for _ in range(25):
        basis, along_u, along_w = spline.rational_basis(u, w, degree, weights)
        gap = vertices - basis @ points
        tangents = np.stack([along_u @ points, along_w @ points], axis=-1)
        step = np.einsum("nij,nj->ni", np.linalg.pinv(tangents), gap)
        u, w = np.clip(u + step[:, 0], 0, 1), np.clip(w + step[:, 1], 0, 1)
        if np.all(np.abs(step) < 1e-10):
            break
    basis, along_u, along_w = spline.rational_basis(u, w, degree, weights)
    gap = vertices - basis @ points
    normals = np.cross(along_u @ points, along_w @ points)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offset = np.einsum("ni,ni->n", gap, normals)
    astray = np.linalg.norm(gap - offset[:, None] * normals, axis=1).max()
    if astray > BINDING_TOLERANCE_M:
        raise ModelError(
            f"a vertex is {astray * 1e3:.1f} mm away from the normal of its closest surface point: the object "
            "folds over or the surface does not cover it; fewer control points or a larger margin help"
        )
    return u, w, offset

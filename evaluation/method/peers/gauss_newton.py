"""Rival: a B-spline sheet fitted to one depth image by Gauss–Newton, compiled, with the stop rule of our descent."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from abs_service.tracker.posterior.curvature import solved
from calib.jit import kernel
from evaluation.scenes.bent_sheet import CAMERA, SIDE, SheetFrame
from evaluation.scenes.surfaces import knots

#: Control points along the long and the short side.
CONTROL = (5, 4)

DEGREE = 3

#: Standard deviations: of an edge's relative change of length, of what is beside the silhouette [m], of a control
#: point's motion between frames [m].
EDGE, BESIDE_M, MOTION_M = 0.02, 0.005, 0.05

#: Measurements that are farther away along the ray are none of the sheet [m].
GATE_M = 0.1

#: The camera has no distortion.
_PINHOLE = (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)

#: Products of two of three axes that differ.
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class GaussNewton:
    """5 × 4 control points; residuals are distances, edge lengths, silhouette and motion.

    The sum over all residuals of products of two basis functions is what a step costs. These products never change, so
    they are made once; a step weighs them with six numbers for each residual.

    Args:
        vertices: the template (n, 3) [m] in its first pose, row by row.
        sigma: standard deviation of the distances [m].
        steps: most steps in a frame.
        tolerance: a step is the last one if the decrease of the cost predicted for it, or for the one after it, is less
            than this per parameter [nats].
        knows_hole: True if the mask of the hole is given; otherwise the hole counts as outside the silhouette.
    """

    def __init__(
        self, vertices: NDArray[np.float64], sigma: float, steps: int, tolerance: float, knows_hole: bool = False
    ):
        self._basis, self._edges = basis(), edges()
        starts, ends = self._edges
        self._rest = np.linalg.norm(vertices[starts] - vertices[ends], axis=1)
        every = np.concatenate([self._basis, self._basis[starts] - self._basis[ends]])
        i, j = np.triu_indices(every.shape[1])
        ends = np.zeros((-len(every) % 4, len(i)))  # four residuals are added at once
        self._products = np.concatenate([every[:, i] * every[:, j], ends]).astype(np.float32)
        self._rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width), np.float32))
        self._control = np.linalg.pinv(self._basis) @ vertices
        self._weights = np.zeros((len(self._products), len(_PAIRS)), np.float32)
        self._pulls = np.zeros_like(vertices)
        self._sigma, self._knows_hole = sigma, knows_hole
        self._steps, self._tolerance = steps, tolerance * self._control.size

    def track(self, frame: SheetFrame) -> NDArray[np.float64]:
        """Vertices (n, 3) [m] in a frame."""
        hidden = frame.hole if self._knows_hole else np.zeros_like(frame.hole)
        nearest = nearest_on(frame.sheet)
        before, decrease_before = self._control, 0.0
        for _ in range(self._steps):
            vertices = self._basis @ self._control
            _weigh_distances(
                vertices, _PINHOLE, frame.sheet, hidden, *nearest, frame.distance, self._rays, self._sigma,
                self._weights, self._pulls,
            )  # fmt: skip
            _weigh_edges(vertices, *self._edges, self._rest, self._weights, self._pulls)
            pull = (self._basis.T @ self._pulls + (before - self._control) / MOTION_M**2).ravel()
            step = solved(self._curvature(), pull)
            self._control = self._control + step.reshape(-1, 3)
            decrease = 0.5 * float(step @ pull)
            if decrease < self._tolerance or decrease**2 < self._tolerance * decrease_before:
                break
            decrease_before = decrease
        return self._basis @ self._control

    def _curvature(self) -> NDArray[np.float64]:
        """Gauss–Newton's approximation (dim, dim) of the second derivatives of the cost."""
        total = np.zeros((len(_PAIRS), self._products.shape[1]), np.float32)
        _accumulate(self._weights, self._products, total)
        curvature = np.empty((self._control.size, self._control.size))
        _unfold(total, curvature)
        curvature.flat[:: len(curvature) + 1] += 1 / MOTION_M**2
        return curvature


def basis() -> NDArray[np.float64]:
    """Values of the basis functions of all control points at all vertices (n, control points)."""
    u, w = (BSpline.design_matrix(np.linspace(0, 1, SIDE), knots(count, DEGREE), DEGREE).toarray() for count in CONTROL)
    return np.kron(w, u)


def edges() -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Vertices at either end of the edges (m,), one diagonal of each cell included."""
    grid = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    steps = [(grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:]), (grid[:-1, :-1], grid[1:, 1:])]
    starts, ends = (np.concatenate([step[i].ravel() for step in steps]) for i in (0, 1))
    return starts, ends


def nearest_on(sheet: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Label (height, width) of the pixel of the sheet nearest to every pixel; row and column of each label (k, 2)."""
    found = cv2.distanceTransformWithLabels(
        (~sheet).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    labels, table = np.asarray(found, np.int32), np.zeros((int(np.count_nonzero(sheet)) + 1, 2), np.int32)
    _locate(sheet, labels, table)
    return labels, table


@kernel
def _locate(sheet: NDArray[np.bool_], labels: NDArray[np.int32], table: NDArray[np.int32]) -> None:
    for row in range(sheet.shape[0]):
        for column in range(sheet.shape[1]):
            if sheet[row, column]:
                table[labels[row, column], 0] = row
                table[labels[row, column], 1] = column


@kernel
def _weigh_distances(
    vertices: NDArray[np.float64],
    pinhole: tuple[float, float, float, float],
    sheet: NDArray[np.bool_],
    hidden: NDArray[np.bool_],
    labels: NDArray[np.int32],
    table: NDArray[np.int32],
    distance: NDArray[np.float32],
    rays: NDArray[np.float64],
    sigma: float,
    weights: NDArray[np.float32],
    pulls: NDArray[np.float64],
) -> None:
    """Weights (n, 6) of the vertices' own residuals, and what these pull at the vertices (n, 3).

    A vertex on the sheet is pulled along its ray, one beside it to the nearest point of the sheet.
    """
    height, width = sheet.shape
    fx, fy, cx, cy = pinhole
    for i in range(len(vertices)):
        x, y = vertices[i, 0] / vertices[i, 2], vertices[i, 1] / vertices[i, 2]
        column = min(max(int(np.floor(fx * x + cx + 0.5)), 0), width - 1)
        row = min(max(int(np.floor(fy * y + cy + 0.5)), 0), height - 1)
        u, v = table[labels[row, column], 0], table[labels[row, column], 1]
        length, along = 0.0, 0.0
        for axis in range(3):
            pulls[i, axis] = rays[u, v, axis] * distance[u, v] - vertices[i, axis]
            along += pulls[i, axis] * vertices[i, axis]
            length += vertices[i, axis] ** 2
        length = np.sqrt(length)
        along /= length
        on = 1 / sigma**2 if sheet[row, column] and abs(along) < GATE_M else 0.0
        beside = 1 / BESIDE_M**2 if not sheet[row, column] else 0.0
        if hidden[row, column]:
            on, beside = 0.0, 0.0
        for pair in range(6):
            p, q = _PAIRS[pair]
            ray_pq = vertices[i, p] * vertices[i, q] / length**2
            weights[i, pair] = on * ray_pq + (beside if p == q else 0.0)
        for axis in range(3):
            pulls[i, axis] = beside * pulls[i, axis] + on * along * vertices[i, axis] / length


@kernel
def _weigh_edges(
    vertices: NDArray[np.float64],
    starts: NDArray[np.intp],
    ends: NDArray[np.intp],
    rest: NDArray[np.float64],
    weights: NDArray[np.float32],
    pulls: NDArray[np.float64],
) -> None:
    """Weights of the edges (n + m, 6), behind those of the vertices; adds what they pull to the vertices' (n, 3)."""
    edge = np.empty(3)
    for k in range(len(starts)):
        square = 0.0
        for axis in range(3):
            edge[axis] = vertices[starts[k], axis] - vertices[ends[k], axis]
            square += edge[axis] ** 2
        length = np.sqrt(square)
        stiffness = 1 / (EDGE * rest[k]) ** 2
        for axis in range(3):
            pull = edge[axis] * stiffness * (rest[k] - length) / length
            pulls[starts[k], axis] += pull
            pulls[ends[k], axis] -= pull
        for pair in range(6):
            p, q = _PAIRS[pair]
            weights[len(vertices) + k, pair] = edge[p] * edge[q] * stiffness / square


@kernel
def _accumulate(weights: NDArray[np.float32], products: NDArray[np.float32], total: NDArray[np.float32]) -> None:
    """Adds to `total` (6, k) products of basis functions (m, k), weighted by (m, 6); m is divisible by four."""
    for m in range(0, len(weights), 4):
        for pair in range(6):
            a, b, c, d = weights[m, pair], weights[m + 1, pair], weights[m + 2, pair], weights[m + 3, pair]
            for k in range(products.shape[1]):
                new = a * products[m, k] + b * products[m + 1, k]
                total[pair, k] += new + (c * products[m + 2, k] + d * products[m + 3, k])


@kernel
def _unfold(total: NDArray[np.float32], curvature: NDArray[np.float64]) -> None:
    """The symmetric matrix (dim, dim) of sums (6, k) by pairs of axes and pairs i ≤ j of control points."""
    k = 0
    for i in range(curvature.shape[0] // 3):
        for j in range(i, curvature.shape[0] // 3):
            for pair in range(6):
                p, q = _PAIRS[pair]
                curvature[3 * i + p, 3 * j + q] = curvature[3 * j + q, 3 * i + p] = total[pair, k]
                curvature[3 * i + q, 3 * j + p] = curvature[3 * j + p, 3 * i + q] = total[pair, k]
            k += 1

"""A B-spline sheet fitted to one depth image by Gauss–Newton, in plain NumPy, residual by residual."""

import cv2
import numpy as np
from numpy.typing import NDArray

from evaluation.method.peers.gauss_newton import BESIDE_M, EDGE, GATE_M, MOTION_M, basis, edges
from evaluation.scenes.bent_sheet import CAMERA, SheetFrame


class GaussNewton:
    """The plain form of `evaluation.method.peers.gauss_newton`; residuals are distances, edges, silhouette and motion.

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
        self._basis, (self._a, self._b) = basis(), edges()
        self._length = np.linalg.norm(vertices[self._a] - vertices[self._b], axis=1)
        self._change = self._basis[self._a] - self._basis[self._b]
        self._control = np.linalg.pinv(self._basis) @ vertices
        self._sigma, self._knows_hole = sigma, knows_hole
        self._steps, self._tolerance = steps, tolerance * self._control.size

    def track(self, frame: SheetFrame) -> NDArray[np.float64]:
        """Vertices (n, 3) [m] in a frame."""
        points = CAMERA.unproject(frame.distance)
        nearest = _nearest_on(frame.sheet)
        before, decrease_before = self._control, 0.0
        for _ in range(self._steps):
            vertices = self._basis @ self._control
            columns, rows = np.floor(CAMERA.project(vertices) + 0.5).astype(int).T
            rows, columns = np.clip(rows, 0, CAMERA.height - 1), np.clip(columns, 0, CAMERA.width - 1)
            use = ~frame.hole[rows, columns] if self._knows_hole else np.ones(len(rows), bool)
            beside = use & ~frame.sheet[rows, columns]
            rows, columns = nearest[:, rows, columns]
            away = points[rows, columns] - vertices
            ray = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
            on = use & ~beside & (np.abs(np.sum(away * ray, axis=1)) < GATE_M)
            edge = vertices[self._a] - vertices[self._b]
            length = np.linalg.norm(edge, axis=1)
            weight = 1 / (EDGE * self._length)
            blocks = [
                _rows(self._basis[on], ray[on] / self._sigma, np.sum(away * ray, axis=1)[on] / self._sigma),
                _rows(self._change, edge * (weight / length)[:, None], (self._length - length) * weight),
                *(
                    _rows(self._basis[beside], np.tile(axis, (beside.sum(), 1)), away[beside] @ axis)
                    for axis in np.eye(3) / BESIDE_M
                ),
                (np.eye(before.size) / MOTION_M, (before - self._control).ravel() / MOTION_M),
            ]
            system, target = (np.concatenate(part) for part in zip(*blocks))
            step = np.linalg.solve(system.T @ system, system.T @ target)
            self._control = self._control + step.reshape(-1, 3)
            decrease = 0.5 * float(step @ (system.T @ target))
            if decrease < self._tolerance or decrease**2 < self._tolerance * decrease_before:
                break
            decrease_before = decrease
        return self._basis @ self._control


def _rows(
    basis: NDArray[np.float64], direction: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows (m, 3 · control points) of residuals that move along directions (m, 3), and what they should become."""
    return np.einsum("mc,mi->mci", basis, direction).reshape(len(basis), 3 * basis.shape[1]), target


def _nearest_on(sheet: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Row and column (2, height, width) of the pixel of the sheet that is nearest to every pixel."""
    labels = cv2.distanceTransformWithLabels(
        (~sheet).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    which = np.asarray(labels, np.intp)
    table = np.zeros((2, int(which.max()) + 1), np.intp)
    table[:, which[sheet]] = np.nonzero(sheet)
    return table[:, which]

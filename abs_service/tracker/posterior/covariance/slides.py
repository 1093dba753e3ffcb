"""Slides: rigid motions of a surface along itself, which leave what is measured as it is.

A cylinder turns about its axis, a board moves between its long edges, and neither a distance nor an edge of its outline
changes. What their residuals seem to tell of such a motion comes from errors of direction: normals of a coarse mesh are
some degrees off, and so are those of its edges. That information is taken away; what is left is what holds the surface.
Gelfand and Guibas, Shape segmentation using local slippage analysis, SGP 2004, find slides by the same eigenvalues.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.terms.linearization import Part, PointLinearization

#: Error of the directions [rad], root mean square, in which residuals tell of motion: of outlines; of images, since
#: a print may hardly change along a direction; of distances, since a surface that bends follows another one beneath
#: it that is so much inclined.
EDGE_ERROR, PRINT_ERROR, NORMAL_ERROR = 0.1, 0.2, 0.3

#: A model moves rigidly if so many of its vertices lack no more than this share of such motions, in squares.
_PROBES, _SMALL_SHARE = 60, 1e-3

#: Number of parameters of a model that moves rigidly only.
_RIGID = 6

#: Precision that keeps the deviation finite [1/m²]: nothing slides by more than a metre.
_LEAST = 1.0


class SlideObservability:
    """Information of the sensors on rigid motions of the surface.

    A model that cannot move so does not slide; a rigid template is held by whatever its known shape shows.
    """

    def __init__(self, model: DeformationModel):
        vertices = model.mesh.vertices.astype(np.float64)
        some = np.linspace(0, len(vertices) - 1, _PROBES).astype(np.intp)
        jacobian = model.sparse_jacobian(model.rest).dense[some].reshape(3 * _PROBES, -1)
        motions = _motions(vertices[some], *_frame(vertices)).reshape(3 * _PROBES, -1)
        left = motions - jacobian @ np.linalg.lstsq(jacobian, motions)[0]
        # A template that does not bend has the directions of its file.
        is_exact = model.mesh.is_complete and len(model.rest) == _RIGID
        self._is_free = bool(np.mean(left**2) < _SMALL_SHARE * np.mean(motions**2)) and not is_exact

    def deviations(self, optimum: Optimum) -> tuple[float, float]:
        """Standard deviation [m] of the vertices, root mean square, along the slide that is held least; 0 without any.

        The second is that without the outline, infinite for a model that does not slide.

        Args:
            optimum: the estimate of a frame; its priors do not count.
        """
        if not self._is_free:
            return 0.0, np.inf
        vertices = optimum.vertices.astype(np.float64)
        frame = _frame(vertices)
        known, feigned = np.zeros((2, len(optimum.sensed), 6, 6))
        for k, part in enumerate(optimum.sensed):
            known[k], feigned[k] = _information(part, *frame)
            feigned[k] *= _direction_error(part) ** 2
        inside = [isinstance(part, PointLinearization) for part in optimum.sensed]
        of_one = _of_one(_motions(vertices, *frame))
        return _least_held(known, feigned, of_one), _least_held(known[inside], feigned[inside], of_one)


def _least_held(known: NDArray[np.float64], feigned: NDArray[np.float64], of_one: NDArray[np.float64]) -> float:
    """Deviation [m] along the slide that is held least, by information of parts, known and feigned (parts, 6, 6)."""
    slides = _slides(known.sum(axis=0), of_one)
    held = np.maximum(_along(slides, known - feigned), 0.0).sum(axis=0)
    return float(1 / np.sqrt(_LEAST + held.min()))


def _direction_error(part: Part) -> float:
    """Error of the directions in which residuals tell of motion [rad]."""
    if isinstance(part, PointLinearization):
        return PRINT_ERROR if part.center.size else NORMAL_ERROR
    return EDGE_ERROR


def _frame(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) of vertices (n, 3), and root mean square of their distances from it [m]."""
    center = vertices.mean(axis=0)
    return center, float(np.sqrt(np.mean(np.square(vertices - center).sum(axis=1))))


def _information(
    part: Part, center: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information of residuals on rigid motions, and what it were in the direction of most, each (6, 6).

    A gradient in an image lies across the line of sight, however steeply that meets the surface, and is off within the
    image only.
    """
    if not len(part.rows):
        return np.zeros((6, 6)), np.zeros((6, 6))
    motions = _motions(part.places, center, size)
    known = (part.rows[:, None] @ motions)[:, 0]
    weighted = motions * np.linalg.norm(part.rows, axis=1)[:, None, None]
    of_most = weighted.reshape(-1, 6).T @ weighted.reshape(-1, 6)
    if isinstance(part, PointLinearization) and part.center.size:  # of an image
        sight = part.places - part.center
        x, y, z = (sight / np.linalg.norm(sight, axis=1)[:, None]).T[..., None]
        unseen = x * weighted[:, 0] + y * weighted[:, 1] + z * weighted[:, 2]
        of_most -= unseen.T @ unseen
    return known.T @ known, of_most


def _of_one(motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motions (6, 6), rows, each of which moves the vertices of motions (n, 3, 6) by 1, root mean square."""
    flat = motions.reshape(-1, 6)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(flat.T @ flat / len(motions) + 1e-9 * np.eye(6))), np.float64)


def _slides(known: NDArray[np.float64], of_one: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motions (6, 6), columns, that information (6, 6) tells apart, of those that move the vertices by 1."""
    return np.asarray(of_one.T @ np.linalg.eigh(of_one @ known @ of_one.T)[1], np.float64)


def _along(slides: NDArray[np.float64], information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Information (parts, 6, 6) along each of the slides (6, 6), columns: (parts, 6)."""
    return np.asarray(np.sum(slides * (information @ slides), axis=1), np.float64)


def _motions(points: NDArray[np.floating], center: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Displacements (n, 3, 6) of points (n, 3) by three shifts and by three turns about a centre, over a size [m]."""
    x, y, z = ((points - center) / size).T
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    motions[:, 1, 3], motions[:, 2, 3] = -z, y
    motions[:, 0, 4], motions[:, 2, 4] = z, -x
    motions[:, 0, 5], motions[:, 1, 5] = -y, x
    return motions

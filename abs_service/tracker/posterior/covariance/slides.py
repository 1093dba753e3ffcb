"""Slides: rigid motions of a surface along itself, which leave what is measured as it is.

A cylinder turns about its axis, a board moves between its long edges, and neither a distance nor an edge of its outline
changes. What their residuals seem to tell of such a motion comes from errors of direction: normals of a coarse mesh are
some degrees off, and so are those of its edges. That information is taken away; what is left is what holds the surface.
Gelfand and Guibas, Shape segmentation using local slippage analysis, SGP 2004, find slides by the same eigenvalues.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.terms.linearization import Part, PointLinearization
from calib.jit import kernel

#: Error of the directions [rad], root mean square, in which residuals tell of motion: of images, since a print may
#: hardly change along a direction; of outlines and distances, since a surface that bends follows another one beneath it
#: that is so much inclined, and so do its edges.
PRINT_ERROR, EDGE_ERROR, NORMAL_ERROR = 0.2, 0.2, 0.3

#: A model moves rigidly if so many of its vertices lack no more than this share of such motions, in squares.
_PROBES, _SMALL_SHARE = 60, 1e-3

#: Number of parameters of a model that moves rigidly only.
_RIGID = 6

#: Precision that keeps the deviation finite [1/m²]: nothing slides by more than a metre.
_MIN_PRECISION = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Slides:
    """Rigid motions of the surface of one estimate, and what holds them.

    Attributes:
        no_outline_deviation_m: `deviation_m` without the outline, infinite for a model that does not slide [m].
        held: information (6,) on each of them [1/m²]; (0,) for a model that does not slide.
        by_outline: what the outline has in it (6,) [1/m²].
        motions: the motions (6, 6), columns, of which each moves the vertices by 1, root mean square; see `_motions`.
        vertices: of the estimate (n, 3) [m].
        size: root mean square of their distances from their centre [m].
    """

    no_outline_deviation_m: float
    held: NDArray[np.float64]
    by_outline: NDArray[np.float64]
    motions: NDArray[np.float64]
    vertices: NDArray[np.float64]
    size: float

    @property
    def deviation_m(self) -> float:
        """Deviation of the vertices, root mean square, along the one that is held least; 0 if none slides [m]."""
        return _deviation(self.held) if len(self.held) else 0.0

    def displacements(self, which: NDArray[np.intp]) -> NDArray[np.float64]:
        """Displacements of the vertices (n, 3, k) by k of the motions."""
        return np.asarray(_motions(self.vertices, *_frame(self.vertices)) @ self.motions[:, which], np.float64)


#: Of a model that does not slide.
NO_SLIDES = Slides(np.inf, np.zeros(0), np.zeros(0), np.zeros((6, 0)), np.zeros((0, 3)), 0.0)


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

    def of(self, optimum: Optimum) -> Slides:
        """The slides of the estimate of a frame; its priors do not count."""
        if not self._is_free:
            return NO_SLIDES
        vertices = optimum.vertices.astype(np.float64)
        frame = _frame(vertices)
        known, feigned = np.zeros((2, len(optimum.sensed), 6, 6))
        for k, part in enumerate(optimum.sensed):
            known[k], feigned[k] = _information(part, *frame)
            feigned[k] *= _direction_error(part) ** 2
        inside = [isinstance(part, PointLinearization) for part in optimum.sensed]
        moved = _moved(vertices, *frame)
        motions, held = _held(known, feigned, moved)
        by_outline, outline = np.zeros(6), np.logical_not(inside)
        add_held(motions, known[outline], feigned[outline], by_outline)
        without_outline = _deviation(_held(known[inside], feigned[inside], moved)[1])
        return Slides(without_outline, held, by_outline, motions, vertices, frame[1])


def _held(
    known: NDArray[np.float64], feigned: NDArray[np.float64], moved: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slides (6, 6), columns, and what holds them (6,), by information of parts, known and feigned (parts, 6, 6)."""
    slides, held = _slides(known.sum(axis=0), moved), np.zeros(6)
    add_held(slides, known, feigned, held)
    return slides, held


def _deviation(held: NDArray[np.float64]) -> float:
    """Deviation [m] along the slide that is held least."""
    return float(1 / np.sqrt(_MIN_PRECISION + held.min()))


def _direction_error(part: Part) -> float:
    """Error of the directions in which residuals tell of motion [rad]."""
    if isinstance(part, PointLinearization):
        return PRINT_ERROR if part.center.size else NORMAL_ERROR
    return EDGE_ERROR


def _frame(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) of vertices (n, 3), and root mean square of their distances from it [m]."""
    center = vertices.mean(axis=0)
    arms = vertices - center
    return center, float(np.sqrt(np.vdot(arms, arms) / len(arms)))


def _information(
    part: Part, center: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information of residuals on rigid motions, and what it were in the direction of most, each (6, 6).

    A measurement tells of a motion what its derivatives and the surface's own have in common. Noise in the two is
    independent. What comes to lie beneath the surface, or beside its end, has no counterpart in it.

    A gradient in an image lies across the line of sight, however steeply that meets the surface, and is off within the
    image only.
    """
    known, possible = np.zeros((2, 6, 6))
    if len(part.rows):
        eye = np.ascontiguousarray(part.center) if isinstance(part, PointLinearization) else np.zeros(0)
        places = np.ascontiguousarray(part.places, np.float64)
        add_information(part.rows, part.of_surface(part.rows), places, eye, center, size, known, possible)
    return known, possible


@kernel
def add_information(
    rows: NDArray[np.float64],
    own: NDArray[np.float64],
    places: NDArray[np.float64],
    eye: NDArray[np.float64],
    center: NDArray[np.float64],
    size: float,
    known: NDArray[np.float64],
    possible: NDArray[np.float64],
) -> None:
    """Adds up (row M)ᵀ(own M) and |row|² Mᵀ(1 − s sᵀ)M, of the motions M (3, 6) of every place; see `_motions`.

    Of the first, the symmetric part.

    Args:
        rows, places: derivatives [1/m] of residuals with respect to their places [m], each (m, 3).
        own: the same derivatives (m, 3), by the surface itself.
        eye: centre (3,) [m] of the lines of sight s, in which an error of the row's direction does not lie; (0,) if s
            is 0.
        center, size: of the motions (3,) [m] and [m].
        known, possible: the sums (6, 6), zeros before.
    """
    seen, shown, unseen, along = np.empty(6), np.empty(6), np.zeros(6), np.zeros((3, 6))
    along[0, 0] = along[1, 1] = along[2, 2] = 1.0
    for m in range(rows.shape[0]):
        a, b, c = rows[m, 0], rows[m, 1], rows[m, 2]
        x, y, z = (
            (places[m, 0] - center[0]) / size,
            (places[m, 1] - center[1]) / size,
            (places[m, 2] - center[2]) / size,
        )
        seen[0], seen[1], seen[2], seen[3], seen[4], seen[5] = a, b, c, y * c - z * b, z * a - x * c, x * b - y * a
        shown[0], shown[1], shown[2] = d, e, f = own[m, 0], own[m, 1], own[m, 2]
        shown[3], shown[4], shown[5] = y * f - z * e, z * d - x * f, x * e - y * d
        along[0, 4], along[0, 5], along[1, 3], along[1, 5], along[2, 3], along[2, 4] = z, -y, -z, x, y, -x
        square = a * a + b * b + c * c
        if eye.size:
            a, b, c = places[m, 0] - eye[0], places[m, 1] - eye[1], places[m, 2] - eye[2]
            length = np.sqrt(a * a + b * b + c * c)
            for i in range(6):
                unseen[i] = (a * along[0, i] + b * along[1, i] + c * along[2, i]) / length
        for i in range(6):
            for j in range(i, 6):
                known[i, j] += 0.5 * (seen[i] * shown[j] + shown[i] * seen[j])
                moved = along[0, i] * along[0, j] + along[1, i] * along[1, j] + along[2, i] * along[2, j]
                possible[i, j] += square * (moved - unseen[i] * unseen[j])
    for i in range(6):
        for j in range(i):
            known[i, j], possible[i, j] = known[j, i], possible[j, i]


def _moved(vertices: NDArray[np.float64], center: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Mean square (6, 6) by which rigid motions move vertices (n, 3) [m], as a quadratic form.

    Args:
        vertices: of the surface.
        center, size: their `_frame`, about which no turn shifts them on average.
    """
    places, moved = (vertices - center) / size, np.eye(6)
    moved[3:, 3:] -= places.T @ places / len(places)
    return moved + 1e-9 * np.eye(6)


def _slides(known: NDArray[np.float64], moved: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motions (6, 6), columns, that information (6, 6) tells apart, of those that move the vertices by 1."""
    return np.asarray(scipy.linalg.lapack.dsygv(known, moved)[1], np.float64)


@kernel
def add_held(
    slides: NDArray[np.float64], known: NDArray[np.float64], feigned: NDArray[np.float64], held: NDArray[np.float64]
) -> None:
    """Adds up what is known and not feigned (parts, 6, 6), where positive, along each of the slides (6, 6), columns."""
    for part in range(known.shape[0]):
        for s in range(held.size):
            along = 0.0
            for i in range(held.size):
                for j in range(held.size):
                    along += slides[i, s] * (known[part, i, j] - feigned[part, i, j]) * slides[j, s]
            held[s] += max(along, 0.0)


def _motions(points: NDArray[np.floating], center: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Displacements (n, 3, 6) of points (n, 3) by three shifts and by three turns about a centre, over a size [m]."""
    x, y, z = ((points - center) / size).T
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    motions[:, 1, 3], motions[:, 2, 3] = -z, y
    motions[:, 0, 4], motions[:, 2, 4] = z, -x
    motions[:, 0, 5], motions[:, 1, 5] = -y, x
    return motions

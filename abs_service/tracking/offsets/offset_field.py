"""Gaussian random field of vertex offsets over a mesh: evidence of each vertex, and a prior that couples neighbours.

Every vertex has evidence, a mean m and a precision p, of its own offset. The prior holds an offset o at a rest r with a
precision a, and neighbours' deviations from it together. The most probable offsets minimise

    Σᵢ pᵢ (oᵢ − mᵢ)² + Σᵢ aᵢ dᵢ² + Σ_edges wᵢⱼ (dᵢ − dⱼ)²,  d = o − r:

a Gaussian Markov random field (Rue and Held, Gaussian Markov Random Fields, 2005), solved by Gauss–Seidel sweeps from
the offsets of the frame before: each takes the weighted mean of its evidence, its rest and what its neighbours say.
Variances are found by belief propagation: every vertex tells each neighbour what it
would know without that neighbour. That is exact on a tree; on the triangles of a mesh, where hearsay returns, it is a
few per cent low.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from calib.jit import kernel

#: Largest change of an offset that ends the sweeps [m], and their largest number; the next frame continues from there.
EXACT_M, SWEEPS = 1e-7, 50

#: Least variance of the difference of two neighbours, as a share of the variance of an offset: the mesh is only just
#: fine enough for its offsets. And the largest, that of independent ones.
ALIKE, INDEPENDENT = 0.25, 2.0

#: Edges of a grid per vertex, and of each vertex inside it: one along, one across, one diagonally.
EDGES_PER_VERTEX, DEGREE = 3, 6


@dataclass(frozen=True, eq=False)
class Prior:
    """Expectation of the offsets before their own evidence.

    Attributes:
        rest: r, where they are held (n,) [m].
        precision: a, of an offset (n,) [1/m²].
        coupling: w, of the difference of two neighbours' deviations from rest [1/m²]; 0 if they are independent.
    """

    rest: NDArray[np.float64]
    precision: NDArray[np.float64]
    coupling: float


class OffsetField:
    """The equations of a mesh's offsets.

    An edge of a vertex with fewer neighbours counts for more, so that the rim is held as firmly as the inside.
    """

    def __init__(self, mesh: Mesh):
        n, edges = len(mesh.vertices), mesh.edges
        both = np.concatenate([edges, edges[:, ::-1]])
        order = np.argsort(both[:, 0], kind="stable")
        source, self._to = both[order].T.astype(np.int64)
        self._start = np.searchsorted(source, np.arange(n + 1))
        place = np.argsort(order)
        self._back = place[(order + len(edges)) % len(both)]  # each direction's opposite
        degree = np.diff(self._start)
        self._share = DEGREE / np.minimum(degree[source], degree[self._to])
        self._total = np.bincount(source, self._share, n)
        self._messages = np.zeros(len(both))

    def solve(
        self, mean: NDArray[np.float64], precision: NDArray[np.float64], prior: Prior, start: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The most probable offsets (n,) [m].

        Args:
            mean, precision: the vertices' own evidence, (n,) [m] and (n,) [1/m²].
            prior: see there.
            start: offsets (n,) [m] from which to begin.
        """
        deviation, diagonal = start - prior.rest, self._diagonal(precision, prior)
        known = precision * (mean - prior.rest)
        _sweep(self._start, self._to, prior.coupling * self._share, diagonal, known, deviation)
        return prior.rest + deviation

    def variance(self, precision: NDArray[np.float64], prior: Prior) -> NDArray[np.float64]:
        """Variance (n,) [m²] of the offsets, after one more round of messages.

        Args:
            precision: of the vertices' own evidence (n,) [1/m²].
            prior: see there.
        """
        result = np.empty(len(precision))
        squares = (prior.coupling * self._share) ** 2
        _tell(self._start, self._back, squares, self._diagonal(precision, prior), self._messages, result)
        return result

    def _diagonal(self, precision: NDArray[np.float64], prior: Prior) -> NDArray[np.float64]:
        return precision + prior.precision + prior.coupling * self._total


@kernel
def _sweep(
    start: NDArray[np.int64],
    to: NDArray[np.int64],
    weights: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    known: NDArray[np.float64],
    deviation: NDArray[np.float64],
) -> None:
    """Solves (diagonal − W) deviation = known in place.

    Args:
        start: first neighbour of every vertex, and the number of all, (n + 1,).
        to: neighbours (k,), the columns of W.
        weights: entries of W (k,) [1/m²].
        diagonal: (n,) [1/m²].
        known: right side (n,) [1/m].
        deviation: start and result (n,) [m].
    """
    for _ in range(SWEEPS):
        moved = 0.0
        for v in range(diagonal.size):
            total = known[v]
            for k in range(start[v], start[v + 1]):
                total += weights[k] * deviation[to[k]]
            value = total / diagonal[v]
            moved = max(moved, abs(value - deviation[v]))
            deviation[v] = value
        if moved < EXACT_M:
            break


@kernel
def _tell(
    start: NDArray[np.int64],
    back: NDArray[np.int64],
    squares: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    messages: NDArray[np.float64],
    variance: NDArray[np.float64],
) -> None:
    """One round of messages, and the variances (n,) [m²] that follow.

    Args:
        start: first neighbour of every vertex, and the number of all, (n + 1,).
        back: index (k,) of the opposite of every direction of an edge.
        squares: of their weights (k,) [1/m⁴].
        diagonal: of the equations (n,) [1/m²].
        messages: along every direction (k,) [m²], from the round before; replaced.
        variance: result.
    """
    before = messages.copy()
    for v in range(variance.size):
        known = diagonal[v]
        for k in range(start[v], start[v + 1]):
            known -= squares[back[k]] * before[back[k]]
        for k in range(start[v], start[v + 1]):
            messages[k] = 1 / (known + squares[back[k]] * before[back[k]])
    for v in range(variance.size):
        rest = diagonal[v]
        for k in range(start[v], start[v + 1]):
            rest -= squares[back[k]] * messages[back[k]]
        variance[v] = 1 / rest


def offset_prior(offset: NDArray[np.float64], deviation: NDArray[np.float64], mesh: Mesh, parameters: int) -> Prior:
    """Prior of the offsets: their variance and that of neighbours' differences, from the first frame.

    Both are what the offsets vary beyond their noise. The surface has already taken a part of that, as it was fitted to
    them. A size below what so many vertices tell of noise is not known to be smaller.

    Args:
        offset, deviation: of the vertices in the first frame, and their σ, (n,) [m].
        mesh: the mesh.
        parameters: of the surface.
    """
    n, (one, other) = len(offset), mesh.edges.T
    noise, left = float(np.mean(deviation**2)), max(1 - parameters / (3 * n), 0.1)
    size = max(float(np.mean(offset**2)) / left - noise, noise * (2 / n) ** 0.5)
    apart = np.mean((offset[one] - offset[other]) ** 2 - deviation[one] ** 2 - deviation[other] ** 2)
    return Prior(np.zeros(n), np.full(n, 1 / size), _coupling(max(float(apart), ALIKE * size), size))


def change_prior(rest: NDArray[np.float64], variance: NDArray[np.float64], apart: float) -> Prior:
    """Offsets that change from a rest (n,) [m] with a variance (n,) [m²], by `apart` [m] (σ) between neighbours."""
    return Prior(rest, 1 / variance, _coupling(apart**2, float(np.mean(variance))))


def _coupling(apart: float, size: float) -> float:
    """Coupling of an edge, from the variances of its ends' difference and of an offset [m²]: what the latter lacks."""
    return max(1 / apart - 1 / (INDEPENDENT * size), 0.0) / EDGES_PER_VERTEX

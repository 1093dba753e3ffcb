"""Stretch prior: relative length changes of the mesh's edges."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, edge_lengths
from abs_service.tracker.models.base import JacobianBlocks, SparseJacobian, Surface
from abs_service.tracker.posterior.priors.edge_runs import EdgeRuns
from abs_service.tracker.terms.grouped import GroupedLinearization
from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel


class StretchPrior:
    """Relative edge-length changes are normal with zero mean; it penalises stretching and shearing, never bending.

    Args:
        mesh: the mesh at rest.
        deviation: standard deviation of the relative change of an edge's length.
    """

    def __init__(self, mesh: Mesh, deviation: float):
        self._edges = mesh.edges
        self._rest = mesh.vertices
        self._inverse_lengths = self._inverse_lengths_of(mesh.vertices)
        self._runs = EdgeRuns(self._edges, self._inverse_lengths, len(mesh.vertices))
        self.deviation, self._inverse_deviation = deviation, 1 / deviation

    def rest_on(self, vertices: NDArray[np.float64]) -> None:
        """Takes the edges' lengths at rest from vertices (n, 3) [m]; the same array again changes nothing."""
        if vertices is not self._rest:
            self._rest, self._inverse_lengths = vertices, self._inverse_lengths_of(vertices)
            self._runs.rest_on(self._inverse_lengths)

    def _inverse_lengths_of(self, vertices: NDArray[np.float64]) -> NDArray[np.float32]:
        return (1 / edge_lengths(vertices, self._edges)).astype(np.float32)

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Negative log-density (population,) of the edge lengths, up to a constant."""
        return self._runs.sum_squares(surface.vertices, 0.5 * self._inverse_deviation**2)

    def linearize(
        self, surface: Surface, sparse_jacobian: SparseJacobian
    ) -> list[GroupedLinearization | Linearization]:
        """The edges' normalised residuals of a population of one; those between groups of vertices in one part."""
        start = np.zeros(len(sparse_jacobian.parameters) + 2, np.int64)
        _count_edges(self._edges, sparse_jacobian.group, start)
        within, residual = start[-2], np.empty(len(self._edges))
        rows = np.empty((within, sparse_jacobian.local.shape[2]))
        across = np.zeros((len(self._edges) - within, sparse_jacobian.dimension))
        scales = self._inverse_lengths * self._inverse_deviation
        edges = surface.vertices[0], self._edges, scales, self._inverse_deviation
        _stretch_rows(*edges, sparse_jacobian.blocks, start[:-1].copy(), residual, rows, across)
        grouped = GroupedLinearization(residual[:within], rows, sparse_jacobian.parameters, start[:-1])
        return [grouped, Linearization(residual[within:], across)]


@kernel
def _count_edges(edges: NDArray[np.int32], group: NDArray[np.int32], start: NDArray[np.int64]) -> None:
    """First index of the sorted edges within each group and of those between groups, into zeros (groups + 2,)."""
    for e in range(edges.shape[0]):
        own, other = group[edges[e, 0]], group[edges[e, 1]]
        start[own + 1 if own == other else start.size - 1] += 1
    for g in range(1, start.size):
        start[g] += start[g - 1]


@kernel
def _stretch_rows(
    vertices: NDArray[np.float32],
    edges: NDArray[np.int32],
    scales: NDArray[np.float32],
    rest: float,
    jacobian: JacobianBlocks,
    place: NDArray[np.int64],
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    across: NDArray[np.float64],
) -> None:
    """Normalised length change of every edge and its derivatives, sorted by group; `place` holds the first indices.

    Args:
        vertices, edges: (3, n) [m] and (edges, 2).
        scales, rest: 1 / (σ length at rest) (edges,) [1/m], and 1 / σ, the scaled length at rest.
        jacobian: of the vertices.
        place: index of the first edge within each group, and of the first between groups.
        residual: (edges,).
        rows: of the edges within a group, by its parameters.
        across: of those between groups by all parameters (edges, dim), zeros before.
    """
    (group, parameters, local), between = jacobian, place.size - 1
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        x = np.float64(vertices[0, i]) - vertices[0, j]
        y = np.float64(vertices[1, i]) - vertices[1, j]
        z = np.float64(vertices[2, i]) - vertices[2, j]
        length = np.sqrt(x * x + y * y + z * z)
        g = group[i] if group[i] == group[j] else between
        to = place[g]
        place[g] += 1
        residual[to] = length * scales[e] - rest
        x, y, z = x * scales[e] / length, y * scales[e] / length, z * scales[e] / length
        if g < between:
            for d in range(local.shape[2]):
                rows[to, d] = (
                    x * (local[i, 0, d] - local[j, 0, d])
                    + y * (local[i, 1, d] - local[j, 1, d])
                    + z * (local[i, 2, d] - local[j, 2, d])
                )
        else:
            row = across[to - rows.shape[0]]
            for d in range(local.shape[2]):
                row[parameters[group[i], d]] += x * local[i, 0, d] + y * local[i, 1, d] + z * local[i, 2, d]
                row[parameters[group[j], d]] -= x * local[j, 0, d] + y * local[j, 1, d] + z * local[j, 2, d]

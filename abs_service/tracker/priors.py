"""What is known about deformations before measuring; terms of the same likelihood, never weights by hand."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from abs_service.tracker.edge_runs import EdgeRuns
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Moves, Surface
from abs_service.tracker.terms.linearization import Linearization, split
from calib.jit import kernel

#: No search gets farther from the prediction than so many deviations of the motion prior.
FARTHEST = 10.0

#: Interval assumed before the first two frames, and the longest over which a motion is extrapolated [s].
FIRST_INTERVAL_S = 1 / 30
LONGEST_INTERVAL_S = 0.5


@dataclass(frozen=True)
class Settings:
    """TOML keys of the priors.

    Attributes:
        stretch: standard deviation of an edge's relative change of length. Paper: 0.01; rubber: 0.2.
        speed: standard deviation of a parameter's rate of change around the predicted one, expressed as the speed of
            the surface that it moves [m/s].
        memory_s: time constant with which the last motion fades from the prediction [s].
    """

    stretch: Annotated[float, Gt(0)] = 0.02
    speed: Annotated[float, Gt(0)] = 0.3
    memory_s: Annotated[float, Gt(0)] = 0.1


class StretchPrior:
    """Relative edge-length changes are normal with zero mean; it penalises stretching and shearing, never bending."""

    def __init__(self, mesh: Mesh, deviation: float):
        self._edges = mesh.edges
        lengths = np.linalg.norm(mesh.vertices[self._edges[:, 0]] - mesh.vertices[self._edges[:, 1]], axis=1)
        self._inverse_lengths = (1 / lengths).astype(np.float32)
        self._runs = EdgeRuns(self._edges, self._inverse_lengths, len(mesh.vertices))
        self._inverse_deviation = 1 / deviation

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Negative log-density (population,) of the edge lengths, up to a constant."""
        return self._runs.sum_squares(surface.vertices, 0.5 * self._inverse_deviation**2)

    def linearize(self, surface: Surface, moves: Moves) -> list[Linearization]:
        """The edges' normalised residuals of a population of one; those between groups of vertices in one part."""
        start = np.zeros(len(moves.parameters) + 2, np.int64)
        _count_edges(self._edges, moves.group, start)
        within, residual = start[-2], np.empty(len(self._edges))
        rows = np.empty((within, moves.local.shape[2]))
        across = np.zeros((len(self._edges) - within, moves.dimension))
        scales = self._inverse_lengths * self._inverse_deviation
        of_points = moves.local, moves.group, moves.parameters
        edges = surface.vertices[0], self._edges, scales, self._inverse_deviation
        _stretch_rows(*edges, *of_points, start[:-1].copy(), residual, rows, across)
        parts = split(residual[:within], rows, start[:-1], moves.parameters)
        return [*parts, Linearization(residual[within:], across)]


class ShapePrior:
    """What a model knows of Θ before any measurement, its `prior`: W (Θ − Θ⁰) is standard normal."""

    def __init__(self, rest: NDArray[np.float64], prior: NDArray[np.float64]):
        self._rest = rest
        self._prior = prior

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        out = np.zeros(len(thetas))
        _add_squares(thetas, self._rest, self._prior, out)
        return out

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives, which are constant."""
        return Linearization(self._prior @ (theta - self._rest), self._prior)


class MotionPrior:
    """Θ_t given the past is normal around the parameters that the last motion predicts.

    Attributes:
        predicted: predicted parameters (dim,) of the frame in hand.
        reach_m: how far from there the surface may be [m].
    """

    def __init__(self, rest: NDArray[np.float64], scales: NDArray[np.float64], settings: Settings):
        self.predicted = rest
        self.reach_m = np.inf
        self._settings, self._scales = settings, scales
        self._theta = rest
        self._velocity = np.zeros_like(rest)
        self._t_ns: int | None = None
        self._elapsed_s = FIRST_INTERVAL_S
        self._inverse_deviation = self._told()

    def predict(self, t_ns: int) -> None:
        """Turns to the frame of time `t_ns` [ns]; the velocity fades with the age of the last estimate."""
        began = self._t_ns is not None
        elapsed_ns = FIRST_INTERVAL_S * 1e9 if self._t_ns is None else max(t_ns - self._t_ns, 1)
        self._elapsed_s = min(elapsed_ns * 1e-9, LONGEST_INTERVAL_S)
        self._t_ns = t_ns
        self._inverse_deviation = self._told()
        self.reach_m = FARTHEST * self._settings.speed * self._elapsed_s if began else np.inf
        travel = self._elapsed_s * np.exp(-self._elapsed_s / self._settings.memory_s)
        self.predicted = self._theta + travel * self._velocity

    def restart(self, theta: NDArray[np.float64]) -> None:
        """Takes parameters (dim,) near which what was lost may be, as if it had not been seen for long."""
        self._theta, self._velocity = theta, np.zeros_like(theta)
        self._t_ns = (self._t_ns or 0) - round(LONGEST_INTERVAL_S * 1e9)

    def update(self, theta: NDArray[np.float64]) -> None:
        """Takes the parameters found for the frame in hand."""
        self._velocity, self._theta = (theta - self._theta) / self._elapsed_s, theta

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative log-density (population,) of parameters (population, dim), up to a constant."""
        out = np.empty(len(thetas))
        _sum_squares(thetas, self.predicted, self._inverse_deviation, out)
        return out

    def linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """The normalised residuals of parameters (dim,), and their derivatives."""
        return Linearization((theta - self.predicted) * self._inverse_deviation, np.diag(self._inverse_deviation))

    def _told(self) -> NDArray[np.float64]:
        """Inverse deviation (dim,) of the parameters around the predicted ones."""
        return 1 / (self._scales * self._settings.speed * self._elapsed_s)


@kernel
def _add_squares(
    thetas: NDArray[np.float64], center: NDArray[np.float64], rows: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Adds half the squared length of every row times Θ − center."""
    for k in range(thetas.shape[0]):
        for r in range(rows.shape[0]):
            length = 0.0
            for d in range(center.size):
                length += rows[r, d] * (thetas[k, d] - center[d])
            out[k] += 0.5 * length * length


@kernel
def _sum_squares(
    thetas: NDArray[np.float64], center: NDArray[np.float64], scales: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Half the squared length of scales times Θ − center."""
    for k in range(thetas.shape[0]):
        total = 0.0
        for d in range(center.size):
            length = scales[d] * (thetas[k, d] - center[d])
            total += length * length
        out[k] = 0.5 * total


@kernel
def _count_edges(edges: NDArray[np.int32], group: NDArray[np.int32], start: NDArray[np.int64]) -> None:
    """Where the edges within each group begin when they are sorted, and those between; zeros (groups + 2,) before."""
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
    local: NDArray[np.float64],
    group: NDArray[np.int32],
    parameters: NDArray[np.int64],
    place: NDArray[np.int64],
    residual: NDArray[np.float64],
    rows: NDArray[np.float64],
    across: NDArray[np.float64],
) -> None:
    """Length times scale of every edge, less what it is at rest, and its derivatives, sorted as `place` says.

    Args:
        vertices, edges: (3, n) [m] and (edges, 2).
        scales, rest: per length at rest (edges,) [1/m], and what that makes of the length at rest.
        local, group, parameters: as in `Moves`.
        place: where the first edge within each group, and the first between groups, go.
        residual: (edges,).
        rows: of the edges within a group, by its parameters.
        across: of those between groups by all parameters (edges, dim), zeros before.
    """
    between = place.size - 1
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

"""Relative length changes of a mesh's edges, computed in the memory order of its vertices."""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel, prange

#: A run's length is a multiple of this compile-time constant: two vectors of eight, without a scalar remainder.
_LANES = 16

#: A block of lanes takes as long as about this many single edges, whose vertices are gathered one by one.
_MIN_EDGES = 4


class EdgeRuns:
    """The edges of a mesh, most of them in runs: vertices i, i + 1, … of which each has an edge to i + offset, ….

    Vertices are numbered along the rows of a grid, within each knot span at least, so most edges that span the same
    offset follow each other. A run goes on where one is missing, as between two rows. Edges that are nearly alone with
    their offset, such as those between knot spans, stay single; in a mesh without any order all do.

    Attributes:
        runs: first vertex, its edge's other end and length in vertices (runs, 3).
        singles: edges (k, 2) in no run.
    """

    def __init__(self, edges: NDArray[np.int32], inverse_lengths: NDArray[np.float32], vertices: int):
        """Sorts edges (k, 2) of so many vertices, every one once and its first vertex before its second.

        Args:
            edges: vertex indices.
            inverse_lengths: 1 / length at rest (k,) [1/m].
            vertices: number of vertices.
        """
        blocks, lane = _blocks(edges.astype(np.int64), vertices)
        single = np.flatnonzero(lane < 0)
        self.runs = _joined(blocks)
        self.singles = np.ascontiguousarray(edges[single])
        lane[single] = _LANES * len(blocks) + np.arange(len(single))
        self._place = lane
        self._inverse_lengths = np.zeros(_LANES * len(blocks) + len(single), np.float32)
        self.rest_on(inverse_lengths)

    def rest_on(self, inverse_lengths: NDArray[np.float32]) -> None:
        """Replaces 1 / length at rest (k,) [1/m]."""
        self._inverse_lengths[self._place] = inverse_lengths

    def sum_squares(self, vertices: NDArray[np.float32], factor: float) -> NDArray[np.float64]:
        """Sum (population,) of the squared relative changes of length, times a factor.

        Args:
            vertices: positions (population, 3, n) [m].
            factor: what the sum is multiplied by.
        """
        out = np.empty(len(vertices))
        _sum_squares(vertices, self.runs, self.singles, self._inverse_lengths, factor, out)
        return out


def _blocks(edges: NDArray[np.int64], vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Covers the edges (k, 2) of every offset by blocks of `_LANES` vertices, where enough are close together.

    Returns:
        blocks: first vertex and offset (blocks, 2), sorted by offset.
        lane: each edge's place (k,) in the sequence of all blocks; −1 for single ones.
    """
    key = (edges[:, 1] - edges[:, 0]) * vertices + edges[:, 0]  # sorts by offset, then by vertex
    order = np.argsort(key)
    keys, lane, blocks = key[order].tolist(), np.full(len(edges), -1), []
    at = 0
    while at < len(keys):
        across, first = divmod(keys[at], vertices)
        first = min(first, vertices - across - _LANES)  # the other ends must not run beyond the last vertex
        end = bisect_left(keys, across * vertices + first + _LANES, at)
        if first >= 0 and end - at >= _MIN_EDGES:
            inside = order[at:end]
            lane[inside] = edges[inside, 0] - first + _LANES * len(blocks)
            blocks.append((first, across))
        at = end
    return np.array(blocks, np.int64).reshape(-1, 2), lane


def _joined(blocks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Runs of blocks that follow each other: first vertex, first other end and length (runs, 3) in vertices."""
    follows = np.all(np.diff(blocks, axis=0) == (_LANES, 0), axis=1)
    begin = np.flatnonzero(np.concatenate([np.ones(min(len(blocks), 1), bool), ~follows]))
    lengths = _LANES * np.diff(begin, append=len(blocks))
    return np.stack([blocks[begin, 0], blocks[begin].sum(axis=1), lengths], axis=1)


@kernel
def _sum_squares(
    vertices: NDArray[np.float32],
    runs: NDArray[np.int64],
    singles: NDArray[np.int32],
    inverse_lengths: NDArray[np.float32],
    factor: float,
    out: NDArray[np.float64],
) -> None:
    """`_sum_of_squares` for every candidate of a population, (population, 3, n) [m]."""
    for k in prange(vertices.shape[0]):
        out[k] = _sum_of_squares(vertices[k], runs, singles, inverse_lengths, factor)


@kernel
def _sum_of_squares(
    place: NDArray[np.float32],
    runs: NDArray[np.int64],
    singles: NDArray[np.int32],
    inverse_lengths: NDArray[np.float32],
    factor: float,
) -> float:
    """Sum over edges of the squared relative change of length times a factor.

    Args:
        place: vertices (3, n) [m].
        runs: first vertex, first other end and length in vertices, a multiple of `_LANES` (runs, 3).
        singles: edges in no run (k, 2).
        inverse_lengths: of the runs' edges, 0 where there is none, and then of the singles [1/m].
        factor: what the sum is multiplied by.
    """
    one, none = np.float32(1), np.float32(0)
    total, done = none, np.uintp(0)
    for r in range(runs.shape[0]):
        # Unsigned: else each is tested for being negative. A sum of its own: runs need not wait for each other.
        i, j, length = np.uintp(runs[r, 0]), np.uintp(runs[r, 1]), np.uintp(runs[r, 2] // _LANES * _LANES)
        part = none
        for e in range(length):
            a, b = i + e, j + e
            x, y, z = place[0, a] - place[0, b], place[1, a] - place[1, b], place[2, a] - place[2, b]
            scale = inverse_lengths[done + e]
            change = np.sqrt(x * x + y * y + z * z) * scale - (one if scale > none else none)
            part += change * change
        total += part
        done += length
    for e in range(np.uintp(singles.shape[0])):
        i, j = np.uintp(singles[e, 0]), np.uintp(singles[e, 1])
        x, y, z = place[0, i] - place[0, j], place[1, i] - place[1, j], place[2, i] - place[2, j]
        change = np.sqrt(x * x + y * y + z * z) * inverse_lengths[done + e] - one
        total += change * change
    return factor * float(total)

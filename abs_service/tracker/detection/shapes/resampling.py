"""Evenly spread vertices on a triangle mesh of any resolution.

Where three cells of the geodesic Voronoi diagram of the vertices meet, the surface gets a face: a Delaunay
triangulation of these vertices on the surface (Valette and Chassery, 2004).
"""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.detection.shapes.samples import farthest_first
from abs_service.tracker.mesh import Mesh, edge_lengths

#: Number of candidates among which vertices are chosen; more are slower and no better.
MAX_CANDIDATES = 12_000

#: Turned away from each other, two points count as this many spacings apart, so that both sides of a thin body have
#: vertices.
SIDES_APART = 1.0


def evenly_spread(mesh: Mesh, count: int) -> NDArray[np.intp]:
    """Indices of `count` vertices of a mesh, evenly spread, the first k for any k."""
    among = np.random.default_rng(0).permutation(len(mesh.vertices))[:MAX_CANDIDATES]
    return among[farthest_first(_places(mesh, count)[among], count)]


def triangulated(mesh: Mesh, chosen: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """A coarser mesh of chosen vertices (k,) of a dense one.

    Returns:
        Those of the chosen vertices that have a face, and the faces (m, 3) of these.
    """
    places, n = _places(mesh, len(chosen)), len(mesh.vertices)
    ends = mesh.edges
    lengths = np.maximum(edge_lengths(places, ends), 1e-12)  # a length of zero would be no edge
    graph = scipy.sparse.coo_array((lengths, ends.T), shape=(n, n)).tocsr()
    nearest = scipy.sparse.csgraph.dijkstra(
        graph, directed=False, indices=chosen, min_only=True, return_predecessors=True
    )[2]
    corners = nearest[mesh.faces]
    meeting = (corners >= 0).all(axis=1) & (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    corners = corners[meeting]
    first = np.argmin(corners, axis=1)
    ordered = np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
    used, faces = np.unique(np.unique(ordered, axis=0), return_inverse=True)
    return used.astype(np.intp), faces.reshape(-1, 3).astype(np.int32)


def _places(mesh: Mesh, count: int) -> NDArray[np.float64]:
    """Positions and scaled normals (n, 6) of the vertices, in which the sides of a thin body are apart."""
    return np.hstack([mesh.vertices, 0.5 * SIDES_APART * np.sqrt(mesh.area / count) * mesh.normals])

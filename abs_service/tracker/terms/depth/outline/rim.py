"""Rim of a mesh, and its distance from the outline in a distance image."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, edges_of, unit
from abs_service.tracker.models.base import JacobianBlocks, Surface
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.synthesis.projection import Projection
from calib.camera import Camera
from calib.jit import kernel

#: Distances (k,) of places (k, 2) in an image inside an outline [px], huge where unknown, and their gradients (k, 2).
Look = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """The outermost vertices of a mesh.

    Attributes:
        outer: their indices (k,); corners, which have no neighbour inside, are left out.
        inner: for each, the nearest vertex (k,) inside that it shares an edge with.
        is_end: True if the object is known to end at the outer vertices.
    """

    outer: NDArray[np.intp]
    inner: NDArray[np.intp]
    is_end: bool = False

    @classmethod
    def of(cls, mesh: Mesh) -> "Rim":
        """The rim of a mesh: vertices on an edge of one face only."""
        edges, count = edges_of(mesh.faces)
        outside = np.zeros(len(mesh.vertices), np.bool_)
        outside[edges[count == 1]] = True
        across = np.concatenate([edges, edges[:, ::-1]])
        across = across[outside[across[:, 0]] & ~outside[across[:, 1]]]
        length = np.linalg.norm(mesh.vertices[across[:, 0]] - mesh.vertices[across[:, 1]], axis=1)
        across = across[np.argsort(length, kind="stable")]
        outer, nearest = np.unique(across[:, 0], return_index=True)
        return cls(outer.astype(np.intp), across[nearest, 1].astype(np.intp), mesh.is_complete)


class Edges(NamedTuple):
    """Edges of a mesh's rim, extrapolated to where the object ends: outer + beyond (outer − inner).

    Attributes:
        outer: outermost vertices (k,).
        inner: for each, a neighbour (k,) inside.
        beyond: for each, the gap to the end of the object (k,), as a share of the distance from the inner vertex.
    """

    outer: NDArray[np.intp]
    inner: NDArray[np.intp]
    beyond: NDArray[np.float32]

    def some(self, which: NDArray[np.intp]) -> "Edges":
        """Some of the edges, by their indices (m,)."""
        return Edges(self.outer[which], self.inner[which], self.beyond[which])

    def ends(self, surface: Surface) -> NDArray[np.float64]:
        """Outermost vertices of a population of one (k, 3) [m]."""
        return surface.vertices[0].T[self.outer].astype(np.float64)

    def starts(self, surface: Surface) -> NDArray[np.float64]:
        """Neighbours inside of the outermost vertices (k, 3) [m]."""
        return surface.vertices[0].T[self.inner].astype(np.float64)

    def points(self, surface: Surface) -> NDArray[np.float32]:
        """The extrapolated rim (1, 3, k) [m] of a population of one."""
        points = np.empty((1, 3, len(self.outer)), np.float32)
        extrapolate_rim(surface.vertices, self, points)
        return points

    def in_image(
        self, camera: Camera, surface: Surface
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Ends of the object by a population of one (k, 3) [m], their places in the image (k, 2) [px], and directions.

        The latter are unit ones out of the mesh, in the image (k, 2).
        """
        both = np.concatenate([self.points(surface)[0].T, surface.vertices[0].T[self.inner]], dtype=np.float64)
        places, starts = project_with_jacobian(camera, both)[0].reshape(2, -1, 2)
        return both[: len(places)], places, unit(places - starts)


class LocatedEdges(NamedTuple):
    """Edges of a population of one in the image.

    Attributes:
        points: where the object ends (k, 3) [m].
        places: the same in the image (k, 2) [px].
        away: their distances inside the outline (k,) [px], see `OutlineImage.inside`.
        directions: unit ones out of the mesh (k, 2).
    """

    points: NDArray[np.float64]
    places: NDArray[np.float64]
    away: NDArray[np.float64]
    directions: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class OutlineImage:
    """Distances from the outline of the object in one depth image.

    Attributes:
        camera: the depth camera.
        projection: of the same camera.
        inwards: distances of the pixels of a part of the image inside the outline (rows, columns) [px], NaN if unknown.
        corner: column and row of the first of these pixels (2,).
    """

    camera: Camera
    projection: Projection
    inwards: NDArray[np.float32]
    corner: NDArray[np.float32]

    def inside(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance inside the outline (k,) of the pixels at places (k, 2) [px]: −∞ far outside, NaN if unknown."""
        return read(self.inwards, self.corner, places, (self.camera.width, self.camera.height))

    def inside_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """`inside` of points (k, 3) [m]."""
        return self.inside(project_with_jacobian(self.camera, points)[0])

    def locate(self, edges: Edges, surface: Surface) -> LocatedEdges:
        """Edges of a population of one in the image."""
        points, places, directions = edges.in_image(self.camera, surface)
        return LocatedEdges(points, places, self.inside(places), directions)

    def look(self, places: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances (k,) of places (k, 2) inside the outline [px], interpolated, and their image gradients (k, 2)."""
        values, gradients = np.empty(len(places)), np.empty((len(places), 2))
        look_up(self.inwards, places - self.corner, values, gradients)
        return values, gradients

    def look_at(self, points: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """`look` of points (1, 3, k) [m], huge where the camera does not see them."""
        (place,), (inverse_z,) = self.projection.project(points)
        place[np.isnan(inverse_z)] = np.nan
        return self.look(place)


@kernel
def look_up(
    image: NDArray[np.float32],
    places: NDArray[np.floating],
    values: NDArray[np.float64],
    gradients: NDArray[np.float64],
) -> None:
    """Values (n,) and gradients (n, 2) of an image at places (n, 2), bilinear; huge and level beyond it and at NaN."""
    height, width = image.shape
    for k in range(places.shape[0]):
        values[k], gradients[k, 0], gradients[k, 1] = 1e9, 0.0, 0.0
        u, v = places[k, 0], places[k, 1]
        if not (u >= 0 and v >= 0 and u < width - 1 and v < height - 1):
            continue
        column, row = int(u), int(v)
        f, g = u - column, v - row
        a, b = image[row, column], image[row, column + 1]
        c, d = image[row + 1, column], image[row + 1, column + 1]
        if np.isnan(a) or np.isnan(b) or np.isnan(c) or np.isnan(d):
            continue
        values[k] = (1 - g) * ((1 - f) * a + f * b) + g * ((1 - f) * c + f * d)
        gradients[k, 0] = (1 - g) * (b - a) + g * (d - c)
        gradients[k, 1] = (1 - f) * (c - a) + f * (d - b)


def read(
    image: NDArray[np.float32], corner: NDArray[np.float32], places: NDArray[np.float64], last: tuple[int, int]
) -> NDArray[np.float64]:
    """Values (n,) of the pixels of a part of an image at places (n, 2); −∞ beside the part, NaN beside the image.

    Args:
        image: the part (rows, columns).
        corner: column and row of its first pixel (2,).
        places: columns and rows; NaN is beside the image.
        last: column and row at which the image ends.
    """
    values = np.empty(len(places))
    _read(image, corner, places, np.array(last, np.float64), values)
    return values


@kernel
def _read(
    image: NDArray[np.float32],
    corner: NDArray[np.float32],
    places: NDArray[np.float64],
    last: NDArray[np.float64],
    values: NDArray[np.float64],
) -> None:
    """See `read`."""
    for k in range(places.shape[0]):
        u, v = places[k, 0], places[k, 1]
        if not (u >= 0 and v >= 0 and u < last[0] and v < last[1]):
            values[k] = np.nan
            continue
        column, row = int(np.floor(u - corner[0] + 0.5)), int(np.floor(v - corner[1] + 0.5))
        inside = row >= 0 and row < image.shape[0] and column >= 0 and column < image.shape[1]
        values[k] = image[row, column] if inside else -np.inf


@kernel
def chain(
    rows: NDArray[np.float64],
    edges: Edges,
    vertices: JacobianBlocks,
    jacobian: NDArray[np.float64],
) -> None:
    """Derivatives of extrapolated edges with respect to theta (k, dim).

    Args:
        rows: derivatives (k, 3) with respect to the extrapolated points.
        edges: of the rim (k,).
        vertices: their derivatives.
        jacobian: zeros before.
    """
    group, parameters, local = vertices
    for k in range(rows.shape[0]):
        for end in range(2):
            beyond = edges.beyond[k]
            v, share = (edges.outer[k], 1.0 + beyond) if end == 0 else (edges.inner[k], 0.0 - beyond)
            own = parameters[group[v]]
            for d in range(own.size):
                along = rows[k, 0] * local[v, 0, d] + rows[k, 1] * local[v, 1, d] + rows[k, 2] * local[v, 2, d]
                jacobian[k, own[d]] += share * along


@kernel
def extrapolate_rim(vertices: NDArray[np.float32], edges: Edges, points: NDArray[np.float32]) -> None:
    """Writes the extrapolated rim (1, 3, k) [m] of one candidate (1, 3, n) [m]."""
    outer, inner, beyond = edges
    for i in range(3):
        of_vertices = vertices[0, i]
        for v in range(outer.size):
            end = of_vertices[outer[v]]
            points[0, i, v] = end + beyond[v] * (end - of_vertices[inner[v]])

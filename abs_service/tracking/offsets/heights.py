"""Heights of measured points above a mesh: residual of a depth image at every vertex, along the normal."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Limits
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.sensor_fit import INLIER_DEVIATIONS
from calib.camera import Camera
from calib.jit import kernel
from calib.noise.base import DepthNoise

#: Measurements at a smaller cosine between line of sight and normal are ignored: they hardly constrain the height.
MIN_COSINE = 0.3

#: Pixels farther away from a vertex are another vertex's, or too many for their use [px].
MAX_RADIUS_PX = 2.5


class Heights(NamedTuple):
    """Heights above the vertices' tangential planes, along the normals.

    Attributes:
        mean: of the measured points (n,) [m]; 0 where nothing is measured.
        precision: 1 / σ² (n,) [1/m²]; 0 where nothing is measured.
    """

    mean: NDArray[np.float64]
    precision: NDArray[np.float64]


class Cutout(NamedTuple):
    """Measured distances (rows, columns) [m] of an image, with the row and the column of the first one."""

    distance: NDArray[np.float32]
    top: int
    left: int


class VertexPixels(NamedTuple):
    """The pixels of every vertex.

    Attributes:
        rows, columns: of its own pixel (n,).
        steps: rows and columns (k, 2) from there to each of its pixels.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    steps: NDArray[np.int64]


class Sighted(NamedTuple):
    """The vertices as a camera sees them.

    Attributes:
        sight: relative to the camera (n, 3) [m].
        distance, cosine: from it (n,) [m], and of the angle between line of sight and normal.
        rows, columns: of every vertex's pixel (n,), or of any pixel near the rest of the mesh.
        seen: all of whose pixels are in the image (n,).
    """

    sight: NDArray[np.float64]
    distance: NDArray[np.float64]
    cosine: NDArray[np.float64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    seen: NDArray[np.bool_]


class Planes(NamedTuple):
    """The tangential plane of every vertex, and what measurements of it are expected to be.

    Attributes:
        sight: vertices relative to the camera (n, 3) [m].
        normals: their unit normals (n, 3).
        cosine: of the angle between the two (n,).
        mean: mean offset of their measurements (n,) [m]; NaN where nothing is to be measured.
        deviation: σ of these (n,) [m].
        variance: of what is known of the heights (n,) [m²], which decides what is an outlier.
    """

    sight: NDArray[np.float64]
    normals: NDArray[np.float64]
    cosine: NDArray[np.float64]
    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    variance: NDArray[np.float64]


class HeightSensor:
    """A depth sensor that measures heights, of every vertex by the pixels that are nearer to it than to others."""

    def __init__(self, camera: Camera, noise: DepthNoise, mesh: Mesh):
        self._camera, self._noise = camera, noise
        one, other = camera.project(mesh.vertices)[mesh.edges].transpose(1, 0, 2)
        spacing = float(np.nanmedian(np.linalg.norm(one - other, axis=1)))
        radius = min(spacing / np.sqrt(np.pi), MAX_RADIUS_PX)  # a disc as large as a cell
        self._reach = int(radius)
        rows, columns = np.mgrid[-self._reach : self._reach + 1, -self._reach : self._reach + 1].reshape(2, -1)
        self._steps = np.stack([rows, columns], axis=1)[np.hypot(rows, columns) <= radius]
        self._rays = (camera.lookup.rays.reshape(-1, 3) @ camera.T_rs[:3, :3].T).reshape(camera.lookup.rays.shape)

    def measure(
        self,
        image: DepthImage,
        vertices: NDArray[np.float64],
        normals: NDArray[np.float64],
        variance: NDArray[np.float64],
    ) -> Heights:
        """Heights in an image above vertices (n, 3) [m] with unit normals (n, 3).

        Args:
            image: the depth image.
            vertices, normals: see above.
            variance: of what is known of the heights (n,) [m²], which decides what is an outlier.
        """
        (sight, distance, cosine, row, column, seen), (top, bottom, left, right) = self._look(vertices, normals)
        measured, amplitude = image.within((slice(top, bottom), slice(left, right)))
        own = amplitude[row - top, column - left].astype(np.float64)
        deviation, mean = self._noise_of(own, distance, (row, column), seen & (cosine > MIN_COSINE))
        found = Heights(*np.empty((2, len(vertices))))
        # One memory layout, for which the kernel is compiled.
        cutout = Cutout(np.ascontiguousarray(measured), top, left)
        planes = Planes(sight, normals, cosine, mean, deviation, variance)
        _mean_heights(cutout, self._rays, VertexPixels(row, column, self._steps), planes, found)
        return found

    def _look(self, vertices: NDArray[np.float64], normals: NDArray[np.float64]) -> tuple[Sighted, Limits]:
        """Vertices (n, 3) [m] with unit normals (n, 3) as the camera sees them, and the part of the image with them."""
        camera, n = self._camera, len(vertices)
        (distance, cosine), (rows, columns) = np.empty((2, n)), np.empty((2, n), np.int64)
        found = Sighted(np.empty((n, 3)), distance, cosine, rows, columns, np.empty(n, np.bool_))
        places = project_with_jacobian(camera, vertices)[0]
        shape = camera.height, camera.width
        return found, _look(vertices, normals, camera.center, places, shape, self._reach, found)

    def _noise_of(
        self,
        amplitude: NDArray[np.float64],
        distance: NDArray[np.float64],
        pixel: tuple[NDArray[np.int64], NDArray[np.int64]],
        wanted: NDArray[np.bool_],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """σ and mean offset (n,) [m] of the vertices' own pixels; the latter is NaN where not wanted or not known."""
        known = np.isfinite(amplitude)
        arguments = distance, np.where(known, amplitude, 0.0), pixel
        usable = wanted & known if self._noise.uses_amplitude else wanted
        return self._noise.deviation(*arguments), np.where(usable, self._noise.mean(*arguments), np.nan)


@kernel
def _look(
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
    center: NDArray[np.float64],
    places: NDArray[np.float64],
    shape: tuple[int, int],
    reach: int,
    found: Sighted,
) -> Limits:
    """Writes what a camera with a centre (3,) [m] and images of a shape sees of vertices at places (n, 2) [px].

    Their pixels are up to so many rows and columns away from their own. Returns the limits of them all.
    """
    (height, width), any_row, any_column = shape, reach, reach
    for v in range(vertices.shape[0] - 1, -1, -1):
        square, along = 0.0, 0.0
        for i in range(3):
            away = vertices[v, i] - center[i]
            found.sight[v, i] = away
            square += away * away
            along += away * normals[v, i]
        found.distance[v] = np.sqrt(square)
        found.cosine[v] = abs(along) / found.distance[v]
        column, row = np.floor(places[v, 0] + 0.5), np.floor(places[v, 1] + 0.5)
        found.seen[v] = column >= reach and column < width - reach and row >= reach and row < height - reach
        if found.seen[v]:  # of the first of them in the end
            any_row, any_column = int(row), int(column)
            found.rows[v], found.columns[v] = any_row, any_column
    top, bottom, left, right = any_row, any_row, any_column, any_column
    for v in range(vertices.shape[0]):
        if not found.seen[v]:
            found.rows[v], found.columns[v] = any_row, any_column
        top, bottom = min(top, found.rows[v]), max(bottom, found.rows[v])
        left, right = min(left, found.columns[v]), max(right, found.columns[v])
    return top - reach, bottom + reach + 1, left - reach, right + reach + 1


@kernel
def _mean_heights(
    cutout: Cutout,
    rays: NDArray[np.float64],
    places: VertexPixels,
    planes: Planes,
    found: Heights,
) -> None:
    """Mean height of the inliers among every vertex's pixels, if they are more than half; else it is not measured.

    Args:
        cutout: of the image, with all pixels of all vertices.
        rays: unit directions of all pixels in the rig frame (height, width, 3).
        places: the pixels of every vertex.
        planes: the planes above which heights are measured.
        found: results.
    """
    (distance, top, left), (rows, columns, steps) = cutout, places
    sight, normals, cosine, mean, deviation, variance = planes
    for v in range(rows.size):
        sigma = deviation[v] * cosine[v]
        limit = INLIER_DEVIATIONS * np.sqrt(sigma * sigma + variance[v])
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        vertex, total, count = sight[v, 0] * x + sight[v, 1] * y + sight[v, 2] * z, 0.0, 0
        for k in range(steps.shape[0]):
            row, column = rows[v] + steps[k, 0], columns[v] + steps[k, 1]
            ray = rays[row, column]
            away = (distance[row - top, column - left] - mean[v]) * (ray[0] * x + ray[1] * y + ray[2] * z) - vertex
            if abs(away) < limit:  # False for NaN
                total += away
                count += 1
        enough = 2 * count > steps.shape[0]
        found.mean[v], found.precision[v] = (total / count, count / (sigma * sigma)) if enough else (0.0, 0.0)

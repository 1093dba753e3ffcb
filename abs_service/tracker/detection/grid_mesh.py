"""The initial mesh of an object of unknown shape: a regular grid over it in the depth image."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.dropouts import sparse_gaps
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.mesh import Mesh, pieces_of
from calib import pose

#: Minimum number of vertices; fewer do not determine a deformation.
MIN_VERTICES = 25

#: Minimum share of a grid point's neighbourhood that shows the object for it to become a vertex.
MIN_COVER = 0.75

#: Least radius around a grid point: within it are three pixels at least, wherever the point lies [px].
MIN_RADIUS_PX = 1.5

#: Largest deviation of a distance around a grid point from their median, beyond which it belongs to another surface:
#: the larger of a length [m] and a number of standard deviations of a distance.
MAX_RELIEF_M, NOISY_RELIEF = 0.03, 3.0

#: Or by more from a plane through all of them, if that is too steep for it: it shows no jump that it does not.
MAX_BEND_M, NOISY_BEND = 0.01, 2.0

#: A triangle with a side longer than this multiple of the typical side spans a jump between two surfaces. A vertex at a
#: jump takes a mean of both surfaces, so one side shows only a part of it (decision 0007); a plane's sides are no
#: longer than that, at any slant up to 70°.
MAX_SIDE = 3.0

#: A connected component with a smaller share of the vertices is an island and removed: the rim of the region often
#: shows background, which cannot be bound to a smooth surface.
MIN_PIECE = 0.1


def grid_mesh(detection: InitialDetection) -> Mesh:
    """Mesh from a grid of nearly square cells over the object in the image, along its minimum-area rectangle.

    A camera measures one distance per direction, so the grid never folds for any shape of the object. Every vertex
    comes from a plane fitted to the distances around it, so it is less noisy than a pixel; grid points off the object
    are left out, so the mesh has the object's outline.

    Returns:
        The mesh without colours; its chart is the grid.

    Raises:
        DetectionError: the object is too small in the image.
    """
    distance, camera = detection.distance, detection.camera
    valid = np.isfinite(distance)
    gaps = sparse_gaps(valid)
    valid |= gaps
    spacing = float(np.sqrt(np.count_nonzero(valid) / detection.vertices))
    grid = _grid(np.argwhere(valid)[:, ::-1].astype(np.float32), spacing)
    rows, columns = grid.shape[:2]
    pixels = grid.reshape(-1, 2)
    reach = max(0.75 * spacing, MIN_RADIUS_PX)
    at_grid, deviation = _local_planes(pixels, distance, gaps, reach, detection.deviation)
    place = np.where(np.isfinite(at_grid), np.arange(rows * columns), -1).reshape(rows, columns)
    positions = pose.transform(camera.T_rs, camera.directions(pixels) * at_grid[:, None])
    faces = _without_islands(_without_jumps(positions, triangles(place)))
    chart = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    used = np.unique(faces)
    if len(used) < MIN_VERTICES:
        raise DetectionError(f"the object is too small in the depth image: {len(used)} vertices, {MIN_VERTICES} needed")
    position_of = np.full(rows * columns, -1, np.int32)
    position_of[used] = np.arange(len(used), dtype=np.int32)
    unknown = np.full((len(used), 3), np.nan, np.float32)
    mesh = Mesh(positions[used], position_of[faces], unknown, chart[used], pixel_deviation=detection.deviation)
    sight = (positions[used] - camera.center) / at_grid[used, None]
    return replace(mesh, deviation=deviation[used] * np.abs(np.einsum("ni,ni->n", mesh.normals, sight)))


def _grid(pixels: NDArray[np.float32], spacing: float) -> NDArray[np.float64]:
    """Pixel coordinates (rows, columns, 2) of a grid over the minimum-area rectangle around pixels (k, 2).

    Its points are the centres of equal cells, so that it ends half a cell inside every side of the rectangle.
    """
    center, size, angle = cv2.minAreaRect(pixels)
    if size[0] < size[1]:
        size, angle = size[::-1], angle + 90
    angle = np.deg2rad((angle + 90) % 180 - 90)  # the long side points right, so that the grid is not mirrored
    right = np.array([np.cos(angle), np.sin(angle)])
    down = np.array([-np.sin(angle), np.cos(angle)])
    across, along = (_cell_centers(length, spacing) for length in size)
    return np.asarray(center) + across[None, :, None] * right + along[:, None, None] * down


def _cell_centers(length: float, spacing: float) -> NDArray[np.float64]:
    """Centres (k,) of equal cells of about a length along a side, from the middle of the side [px]."""
    cells = max(round(length / spacing), 1)
    return (np.arange(0.5, cells) - 0.5 * cells) * float(length / cells)


def _local_planes(
    pixels: NDArray[np.float64], distance: NDArray[np.float32], gaps: NDArray[np.bool_], radius: float, noise: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance [m] at pixel coordinates (g, 2) from a plane fitted around each, and its standard deviation [m].

    Both are NaN off the object; the pixels `gaps` (height, width) are on it, without a return. The deviation of a
    single pixel is estimated from the residuals of all planes together, because a single plane may have no more pixels
    than coefficients.
    """
    reach = int(np.ceil(radius))
    steps = np.stack(np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)), axis=-1).reshape(-1, 2)
    around = np.floor(pixels[:, None] + 0.5).astype(int) + steps
    offset = around - pixels[:, None]
    within = np.linalg.norm(offset, axis=2) <= radius
    inside = np.all((around >= 0) & (around < distance.shape[::-1]), axis=2)
    column, row = np.moveaxis(np.where(inside[..., None], around, 0), -1, 0)
    values = np.where(within & inside, distance[row, column], np.nan).astype(np.float64)
    near = np.abs(values - _row_medians(values)) < max(MAX_RELIEF_M, NOISY_RELIEF * noise)
    known = np.isfinite(values)
    area, seen = np.count_nonzero(within, axis=1), np.count_nonzero(known, axis=1)
    bridged = np.count_nonzero(within & inside & gaps[row, column], axis=1)
    minimum = np.max([MIN_COVER * area - bridged, MIN_COVER * seen, np.full(len(area), 3)], axis=0)
    steep = np.flatnonzero((np.count_nonzero(near, axis=1) < minimum) & (seen >= minimum))
    bend = max(MAX_BEND_M, NOISY_BEND * noise)
    near[steep] = np.abs(values[steep] - _planes(values[steep], offset[steep], known[steep])[0]) < bend
    count = np.count_nonzero(near, axis=1)
    usable = np.flatnonzero(count >= minimum)
    near, values = near[usable], np.where(near[usable], values[usable], 0.0)
    fitted, inverse = _planes(values, offset[usable], near)
    result, share = np.full((2, len(pixels)), np.nan)
    result[usable], share[usable] = (inverse[:, :1] @ values[..., None])[:, 0, 0], np.linalg.norm(inverse[:, 0], axis=1)
    squares = float(np.sum((values - fitted) ** 2))
    return result, share * np.sqrt(squares / max(int(np.sum(count[usable] - 3)), 1))


def _planes(
    values: NDArray[np.float64], offset: NDArray[np.float64], used: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Planes through the used ones of values (g, s) at pixel offsets (g, s, 2).

    Returns:
        Their values there (g, s), 0 for the others, and their pseudoinverses (g, 3, s): coefficients from values.
    """
    rows = np.concatenate([used[..., None], offset * used[..., None]], axis=2)
    transposed = rows.transpose(0, 2, 1)
    inverse = np.linalg.pinv(transposed @ rows, rcond=1e-10, hermitian=True) @ transposed  # pixels may lie in a line
    return (rows @ (inverse @ np.where(used, values, 0.0)[..., None]))[..., 0], inverse


def _row_medians(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Medians (g, 1) of the finite values in each row (g, s); NaN for a row without any."""
    medians = np.full((len(values), 1), np.nan)
    some = np.isfinite(values).any(axis=1)
    medians[some, 0] = np.nanmedian(values[some], axis=1)
    return medians


def triangles(place: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (m, 3) of a grid of vertex indices (rows, columns), −1 for none; oriented towards the camera.

    A cell with four vertices has two triangles, a cell with three has one.
    """
    corners = np.stack([place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]], axis=-1).reshape(-1, 4)
    whole = np.all(corners >= 0, axis=1)
    faces = []
    for triangle, opposite in (([0, 1, 2], 3), ([0, 2, 3], 1), ([0, 1, 3], 2), ([1, 2, 3], 0)):
        wanted = whole if opposite in (1, 3) else np.zeros_like(whole)
        keep = (wanted | (corners[:, opposite] < 0)) & np.all(corners[:, triangle] >= 0, axis=1)
        faces.append(corners[keep][:, triangle])
    return np.concatenate(faces)


def _without_jumps(positions: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles (m, 3) that do not span a jump in distance."""
    if not len(faces):
        return faces
    sides = np.linalg.norm(positions[faces] - positions[np.roll(faces, 1, axis=1)], axis=2)
    return faces[sides.max(axis=1) < MAX_SIDE * np.median(sides)]


def _without_islands(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles (m, 3) of the connected components that are large enough."""
    piece, sizes = pieces_of(faces)
    return faces[sizes[piece] >= MIN_PIECE * sizes.sum()]

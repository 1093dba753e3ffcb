"""The initial mesh: a grid laid over the object in the first depth image."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from abs_service.observation import ColorImage, DepthImage, Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.regions.base import Region, RegionError
from calib.camera import Camera
from calib.rig import Rig

LEAST_VERTICES = 25


def initial_mesh(observation: Observation, rig: Rig, reference: str, region: Region, vertices: int) -> Mesh:
    """Makes a triangle mesh of about `vertices` vertices over the object that the reference sensor sees.

    Raises:
        RegionError: the reference sensor sees no object, or too little of it.
    """
    image = observation.images.get(reference)
    if not isinstance(image, DepthImage):
        raise RegionError(f"no depth image from {reference} yet")
    camera = rig.sensors[reference].camera
    points = camera.unproject(image.distance)
    inside = region.select(points, image.distance)
    positions, faces = grid_mesh(points[inside], camera.center, vertices)
    return Mesh(positions, faces, vertex_colors(positions, observation.images, rig))


def grid_mesh(
    points: NDArray[np.float64], center: NDArray[np.float64], vertices: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Lays a square grid over a cloud of surface points.

    Every vertex is the fit of a local plane to the points around it, so it is less noisy than a pixel; cells
    without points stay empty, so the mesh has the object's outline.

    Args:
        points: surface points (k, 3) [m].
        center: camera centre (3,); faces are counter-clockwise seen from there.
        vertices: about how many vertices the mesh is to have.

    Returns:
        Vertices (n, 3) [m] and faces (m, 3).
    """
    origin, axes = _principal_frame(points, center)
    local = (points - origin) @ axes.T
    spacing = np.sqrt(_area(local[:, :2], len(points)) / vertices)
    columns, rows = (np.ceil(np.ptp(local[:, :2], axis=0) / spacing).astype(int) + 1).tolist()
    low = (local[:, :2].max(axis=0) + local[:, :2].min(axis=0) - np.array([columns - 1, rows - 1]) * spacing) / 2
    grid = low + np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) * spacing
    height, found = _local_planes(grid, local, 0.75 * spacing)
    place = np.where(found, np.cumsum(found) - 1, -1).reshape(rows, columns)
    corners = np.stack([place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]], axis=-1).reshape(-1, 4)
    whole = np.all(corners >= 0, axis=1)
    faces = []
    for triangle, opposite in (([0, 1, 2], 3), ([0, 2, 3], 1), ([0, 1, 3], 2), ([1, 2, 3], 0)):
        wanted = whole if opposite in (1, 3) else np.zeros_like(whole)
        keep = (wanted | (corners[:, opposite] < 0)) & np.all(corners[:, triangle] >= 0, axis=1)
        faces.append(corners[keep][:, triangle])
    vertices_local = np.concatenate([grid, height[:, None]], axis=1)[found]
    return _connected(vertices_local @ axes + origin, np.concatenate(faces).astype(np.int32))


def vertex_colors(
    positions: NDArray[np.float64], images: Mapping[str, DepthImage | ColorImage], rig: Rig
) -> NDArray[np.float32]:
    """Mean colour (n, 3) of every vertex over the colour sensors that see it, NaN where none does."""
    total, count = np.zeros((len(positions), 3)), np.zeros((len(positions), 1))
    for name, image in images.items():
        if isinstance(image, ColorImage):
            color = _colors_in(image, rig.sensors[name].camera, positions)
            seen = np.isfinite(color).all(axis=1)
            total[seen] += color[seen]
            count[seen] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def _colors_in(image: ColorImage, camera: Camera, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    pixel = np.floor(camera.project(positions) + 0.5)
    inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=1)
    colors = np.full((len(positions), 3), np.nan)
    column, row = pixel[inside].astype(int).T
    colors[inside] = image.rgb[row, column]
    return colors


def _principal_frame(
    points: NDArray[np.float64], center: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origin and axes (rows: long side, short side, normal to the camera) of the smallest rectangle around points."""
    origin = points.mean(axis=0)
    axes = np.linalg.svd(points - origin, full_matrices=False)[2]
    rectangle = cv2.minAreaRect(((points - origin) @ axes[:2].T).astype(np.float32))
    angle = np.deg2rad(rectangle[2] + (90 if rectangle[1][0] < rectangle[1][1] else 0))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    plane = turn @ axes[:2]
    normal = np.cross(plane[0], plane[1])
    if np.dot(normal, center - origin) < 0:
        plane[1], normal = -plane[1], -normal
    return origin, np.stack([plane[0], plane[1], normal])


def _area(local: NDArray[np.float64], count: int) -> float:
    """Area [m²] that points in the plane cover: their number times the square of their typical spacing."""
    nearest = KDTree(local).query(local, k=5)[0][:, 4]
    hull = cv2.contourArea(cv2.convexHull(local.astype(np.float32)))
    return float(min(count * np.median(nearest) ** 2, hull))


def _local_planes(
    grid: NDArray[np.float64], local: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Height of the surface at every grid point (g,) and whether the object reaches it.

    A grid point counts as covered if points surround it: their mean lies near it.
    """
    tree = KDTree(local[:, :2])
    height, found = np.zeros(len(grid)), np.zeros(len(grid), bool)
    for i, neighbors in enumerate(tree.query_ball_point(grid, radius)):
        if len(neighbors) < 4:
            continue
        around = local[neighbors]
        offset = around[:, :2] - grid[i]
        if np.linalg.norm(offset.mean(axis=0)) > 0.4 * radius:
            continue
        plane = np.linalg.lstsq(np.column_stack([np.ones(len(offset)), offset]), around[:, 2], rcond=None)[0]
        height[i], found[i] = plane[0], True
    return height, found


def _connected(
    positions: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The mesh without vertices that no face uses."""
    used = np.unique(faces)
    if len(used) < LEAST_VERTICES:
        raise RegionError(f"the object is too small in the depth image: {len(used)} vertices, {LEAST_VERTICES} needed")
    place = np.full(len(positions), -1, np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    return positions[used], place[faces]

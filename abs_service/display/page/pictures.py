"""Images of a rig as points and as pictures with the mesh drawn over them."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, edges_of
from calib.camera import Camera
from calib.pose import transform
from drivers.contract.frame import Frame, Geometry, Kind

Picture = NDArray[np.uint8]

#: Points (n, 3) [m] in rig coordinates, the row and column (n, 2) of each, and the spacing of neighbours [m].
Cloud = tuple[NDArray[np.float32], NDArray[np.intp], float]

#: Width of pictures [px], and the largest number of points of a sensor.
WIDTH, POINTS = 480, 20_000

#: Percentiles of an image's values at the ends of its colours.
SHOWN_PERCENT = (1, 99)

MESH, NO_RETURN = (255, 255, 255), (22, 37, 110)

#: Colours of the rim by `DeformedMesh.rim_classes_u8`: green where it is a free edge or unknown, orange for contact,
#: violet for a silhouette, grey for what is occluded, and blue for a border of the image.
RIM = ((0, 230, 160), (0, 230, 160), (255, 150, 30), (200, 110, 255), (170, 170, 170), (60, 150, 255))

_BAYER = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2RGB,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2RGB,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2RGB,
}


def radial(frame: Frame, camera: Camera) -> NDArray[np.floating]:
    """Radial distances (height, width) [m] of a depth frame, NaN without return."""
    distance = frame.si()
    return distance / camera.rays()[..., 2] if frame.geometry == Geometry.Z else distance


def cloud(distance: NDArray[np.floating], camera: Camera) -> Cloud:
    """Points (n, 3) [m] in rig coordinates of every k-th pixel with a return, its row and column, and spacing [m].

    Args:
        distance: radial distances (height, width) [m].
        camera: of the image.
    """
    step = max(1, int(np.ceil(np.sqrt(distance.size / POINTS))))
    pixels = step * np.argwhere(np.isfinite(distance[::step, ::step]))
    row, column = pixels.T
    points_s = camera.rays()[row, column] * distance[row, column, None]
    spacing_m = step * float(np.median(distance[row, column])) / camera.fx if len(pixels) else 0.0
    return transform(camera.T_rs, points_s).astype(np.float32), pixels, spacing_m


def under_ray(
    points: NDArray[np.floating], origin: NDArray[np.floating], direction: NDArray[np.floating], reach_m: float
) -> int | None:
    """Index of the point that a ray meets: of those in front, the one nearest to it; None if none is within reach.

    Args:
        points: positions (n, 3) [m].
        origin: of the ray (3,) [m].
        direction: of the ray (3,), of length 1.
        reach_m: largest distance of the point from the ray [m].
    """
    away = points - origin
    along = away @ direction
    beside = np.linalg.norm(away - along[:, None] * direction, axis=1)
    met = (along > 0) & (beside <= reach_m)
    if not met.any():
        return None
    in_front = met & (along <= along[met].min() + 2 * reach_m)
    return int(np.argmin(np.where(in_front, beside, np.inf)))


def picture(frame: Frame) -> Picture:
    """A frame as red, green, blue (height, width, 3): distances in false colours, other images unchanged."""
    if frame.encoding in _BAYER:
        return np.asarray(cv2.cvtColor(np.asarray(frame.data, np.uint8), _BAYER[frame.encoding]), np.uint8)
    if frame.data.ndim == 3:
        return np.asarray(frame.data if frame.encoding == "rgb8" else frame.data[..., ::-1], np.uint8)
    values = frame.si()
    known = np.isfinite(values)
    low, high = np.percentile(values[known][::7], SHOWN_PERCENT) if known.any() else (0.0, 1.0)
    grey = (255 * np.clip((np.nan_to_num(values) - low) / max(high - low, 1e-9), 0, 1)).astype(np.uint8)
    if frame.kind != Kind.DEPTH:
        return np.repeat(grey[..., None], 3, axis=2)
    colored = cv2.applyColorMap(255 - grey, cv2.COLORMAP_TURBO)[..., ::-1].copy()
    colored[~known] = NO_RETURN
    return np.asarray(colored, np.uint8)


def with_mesh(
    image: Picture,
    camera: Camera,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    classes: NDArray[np.uint8] | None = None,
) -> Picture:
    """A picture `WIDTH` pixels wide, with the edges of a mesh and its rim drawn over it.

    Args:
        image: of the camera, (height, width, 3).
        camera: that took it.
        vertices: positions (n, 3) [m] in rig coordinates.
        faces: vertex indices (m, 3); none draws nothing.
        classes: of the rim, for each vertex (n,); none draws it in one colour.
    """
    drawn = _enlarged(image)
    if not len(faces):
        return drawn
    corners, within = _corners(camera, vertices, WIDTH / image.shape[1])
    edges, rim = Mesh(vertices, faces, np.empty((0, 3), np.float32), np.empty((0, 2))).edges, rim_edges(faces)
    lines = drawn.copy()
    cv2.polylines(lines, list(corners[edges[within[edges].all(axis=1)]]), False, MESH, 1, cv2.LINE_AA, 4)
    drawn = cv2.addWeighted(drawn, 0.6, lines, 0.4, 0)
    rim = rim[within[rim].all(axis=1)]
    # Corners of the mesh have no class of their own.
    of_edges = np.zeros(len(rim), np.uint8) if classes is None else classes[rim].max(axis=1)
    of_edges[of_edges >= len(RIM)] = 0  # of a later version
    for number, color in enumerate(RIM):
        cv2.polylines(drawn, list(corners[rim[of_edges == number]]), False, color, 2, cv2.LINE_AA, 4)
    return np.asarray(drawn, np.uint8)


def with_colors(
    image: Picture,
    camera: Camera,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    values: NDArray[np.floating],
    color: Callable[[NDArray[np.float64]], Picture],
) -> Picture:
    """A picture in grey, `WIDTH` pixels wide, and over it the faces of a mesh in colours, the nearest on top.

    Args:
        image: of the camera, (height, width, 3).
        camera: that took it.
        vertices: positions (n, 3) [m] in rig coordinates.
        faces: vertex indices (m, 3).
        values: of the vertices (n,); a face has the mean of its corners, and is left out where one is NaN.
        color: red, green, blue (k, 3) of values (k,).
    """
    drawn = _enlarged(grey(image))
    corners, within = _corners(camera, vertices, WIDTH / image.shape[1])
    mean = values[faces].mean(axis=1)
    shown = np.flatnonzero(np.isfinite(mean) & within[faces].all(axis=1))
    shown = shown[np.argsort(-camera.distance(vertices)[faces[shown]].mean(axis=1))]
    for face, tone in zip(corners[faces[shown]], color(mean[shown]).tolist()):
        cv2.fillConvexPoly(drawn, face, tone, cv2.LINE_8, 4)
    return drawn


def rim_edges(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Vertex indices (k, 2) of the edges that belong to one face only."""
    edges, count = edges_of(faces)
    return edges[count == 1]


def grey(image: Picture) -> Picture:
    """A stale picture: without colours, and darker."""
    return np.repeat((cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) // 2 + 40)[..., None], 3, axis=2)


def _enlarged(image: Picture) -> Picture:
    """A picture `WIDTH` pixels wide."""
    factor = WIDTH / image.shape[1]
    by = cv2.INTER_AREA if factor < 1 else cv2.INTER_NEAREST
    return np.ascontiguousarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=by), np.uint8)


def _corners(
    camera: Camera, vertices: NDArray[np.float64], factor: float
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Places (n, 2) of vertices in a picture `factor` times as large [1/16 px], and those that have one (n,)."""
    place = factor * (camera.project(vertices) + 0.5) - 0.5
    within = np.asarray(np.isfinite(place).all(axis=1), np.bool_)
    return np.round(16 * np.clip(np.where(within[:, None], place, 0), -1e4, 1e4)).astype(np.int32), within

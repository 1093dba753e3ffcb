"""Detection of a flat rectangular sheet in a depth image."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.dropouts import fill_gaps
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from calib import pose
from calib.camera import Camera
from calib.pose import Pose

#: Maximum number of points for the fits of plane and paraboloid; more are slower but not more accurate.
MAX_POINTS = 5000


@dataclass(frozen=True)
class Limits:
    """Thresholds of the detection.

    Attributes:
        minimum_pixels: minimum number of pixels; the sides of a smaller sheet cannot be fitted.
        maximum_bow_m: largest height of a fitted paraboloid over the object for it to be flat [m].
        minimum_gap_m: lower bound of the largest distance of the sheet's pixels from its plane, for small noise [m].
        minimum_overlap: minimum intersection over union of object and rectangle. A disc has 0.90, a sheet of 450 pixels
            0.96 and more, a sheet of which a finger occludes 6 % has 0.94.
    """

    minimum_pixels: int = 200
    maximum_bow_m: float = 0.02
    minimum_gap_m: float = 0.01
    minimum_overlap: float = 0.93


LIMITS = Limits()


def find_sheet(detection: InitialDetection, limits: Limits = LIMITS) -> Sheet:
    """Fits a plane to the points of a sheet, and a rectangle to its outline on that plane.

    The x axis points right if the long side is nearer to horizontal in the image, otherwise up.

    Raises:
        DetectionError: too little is visible, or the object is not flat, or not a rectangle.
    """
    camera = detection.camera
    seen = np.isfinite(detection.distance)
    if np.count_nonzero(seen) < limits.minimum_pixels:
        raise DetectionError(
            f"the object has {np.count_nonzero(seen)} pixels, a sheet needs minimum_pixels = {limits.minimum_pixels}"
        )
    window = _window(seen)
    rows, columns = np.indices(seen.shape)[:, *window]
    rays = camera.directions(np.stack([columns, rows], axis=-1)) @ camera.T_rs[:3, :3].T
    points = camera.center + rays * fill_gaps(detection.distance)[window][..., None]
    T_rp = _plane(points[seen[window]], camera)
    pixels = _pixels_on_plane(pose.transform(pose.inverse(T_rp), points), limits)
    corner = np.array([columns[0, 0], rows[0, 0]])
    outline_rays = camera.directions(corner + _outline(pixels)) @ camera.T_rs[:3, :3].T
    sheet = _rectangle(_meet(outline_rays, camera.center, T_rp), T_rp)
    _check_overlap(pixels, _meet(rays, camera.center, sheet.T_rp), sheet, limits.minimum_overlap)
    return sheet


def _window(seen: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns of the bounding box of the set pixels of an image (height, width), with a margin."""
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return slice(max(rows[0] - 2, 0), rows[-1] + 3), slice(max(columns[0] - 2, 0), columns[-1] + 3)


def _plane(points: NDArray[np.float64], camera: Camera) -> Pose:
    """The plane with the least absolute distances from points (k, 3); x to the camera's right, z away from it."""
    points = points[:: len(points) // MAX_POINTS + 1]
    center, normal = np.mean(points, axis=0), camera.T_rs[:3, 2]
    weights = np.ones(len(points))
    for _ in range(20):
        center = np.average(points, axis=0, weights=weights)
        arms = points - center
        normal = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1][:, 0]
        weights = 1 / np.maximum(np.abs(arms @ normal), 1e-3)
    z = normal * np.sign(normal @ (center - camera.center))
    x = camera.T_rs[:3, 0] - z * (z @ camera.T_rs[:3, 0])
    x /= np.linalg.norm(x)
    T_rp = np.eye(4)
    T_rp[:3] = np.stack([x, np.cross(z, x), z, center], axis=1)
    return T_rp


def _pixels_on_plane(points_p: NDArray[np.float64], limits: Limits) -> NDArray[np.bool_]:
    """The largest connected component of pixels (height, width) near the plane z = 0; specks are ignored.

    Raises:
        DetectionError: the points (height, width, 3), NaN without return, do not lie on a plane.
    """
    valid = points_p[np.isfinite(points_p[..., 2])]
    _check_flat(valid, limits.maximum_bow_m)
    gap = max(4 * 1.4826 * float(np.median(np.abs(valid[:, 2]))), limits.minimum_gap_m)
    near = (np.abs(points_p[..., 2]) < gap).astype(np.uint8)  # False for NaN
    labels, statistics = cv2.connectedComponentsWithStats(cv2.medianBlur(near, 3))[1:3]
    return np.asarray(labels == 1 + np.argmax(statistics[1:, cv2.CC_STAT_AREA]))


def _check_flat(points_p: NDArray[np.float64], maximum_bow_m: float) -> None:
    """Fits a paraboloid to points (k, 3), which averages their noise.

    Raises:
        DetectionError: its height over the points exceeds `maximum_bow_m`.
    """
    a, b, z = points_p[:: len(points_p) // MAX_POINTS + 1].T
    arch = np.column_stack([a * a, a * b, b * b])
    terms = np.column_stack([arch, np.ones_like(a), a, b])
    coefficients = np.zeros(6)
    for _ in range(10):
        weight = 1 / np.sqrt(np.maximum(np.abs(z - terms @ coefficients), 1e-3))
        coefficients = np.linalg.lstsq(terms * weight[:, None], z * weight, rcond=None)[0]
    bow = float(np.ptp(arch @ coefficients[:3]))
    if bow > maximum_bow_m:
        raise DetectionError(
            f"the object arches by {bow * 1e3:.0f} mm, more than maximum_bow_m = {maximum_bow_m:g} m; a sheet must be "
            "flat to be found"
        )


def _outline(pixels: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Pixel coordinates (k, 2) halfway between a set and an unset neighbour: the rim to half a pixel."""
    padded = np.pad(pixels, 1)
    row, column = np.nonzero(padded[:, 1:] != padded[:, :-1])
    across = np.column_stack([column - 0.5, row - 1.0])
    row, column = np.nonzero(padded[1:] != padded[:-1])
    return np.asarray(np.concatenate([across, np.column_stack([column - 1.0, row - 0.5])]), np.float64)


def _meet(rays: NDArray[np.float64], center: NDArray[np.float64], T_rp: Pose) -> NDArray[np.float64]:
    """Coordinates (…, 2) on a plane [m] of its intersections with lines of sight (…, 3) from a camera's centre."""
    rays_p, center_p = rays @ T_rp[:3, :3], pose.transform(pose.inverse(T_rp), center)
    return np.asarray(center_p[:2] - rays_p[..., :2] * (center_p[2] / rays_p[..., 2:]), np.float64)


def _rectangle(outline: NDArray[np.float64], T_rp: Pose) -> Sheet:
    """The rectangle, with its pose, of the least absolute distances from an outline (k, 2) on a plane."""
    middle, _, degrees = cv2.minAreaRect(outline.astype(np.float32))
    angle, arms = np.deg2rad(degrees), outline - middle
    sides = np.zeros((2, 2))  # rows: first and second axis; columns: low, high
    for turn in range(15):
        local = arms @ _axes(angle).T
        sides = np.stack([local.min(axis=0), local.max(axis=0)], axis=1) if turn == 0 else sides
        gaps = (local[:, :, None] - sides).reshape(-1, 4)
        side = np.argmin(np.abs(gaps), axis=1)
        gap = gaps[np.arange(len(gaps)), side]
        lever = np.where(side < 2, local[:, 1], -local[:, 0])
        design = np.column_stack([side[:, None] == np.arange(4), -lever])
        weight = 1 / np.sqrt(np.maximum(np.abs(gap), np.median(np.abs(gap)) + 1e-9))
        step = np.linalg.lstsq(design * weight[:, None], gap * weight, rcond=None)[0]
        sides, angle = sides + step[:4].reshape(2, 2), angle + step[4]
    size = sides[:, 1] - sides[:, 0]
    center = np.asarray(middle) + sides.mean(axis=1) @ _axes(angle)
    if size[0] < size[1]:
        size, angle = size[::-1], angle + np.pi / 2
    angle = np.pi / 4 - (np.pi / 4 - angle) % np.pi  # −135° … 45° from the camera's right, clockwise
    T_ps = pose.from_rotation_vector((0, 0, angle), (*center, 0))
    return Sheet(T_rp @ T_ps, float(size[0]), float(size[1]))


def _axes(angle: float) -> NDArray[np.float64]:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _check_overlap(
    pixels: NDArray[np.bool_], places: NDArray[np.float64], sheet: Sheet, minimum_overlap: float
) -> None:
    """Compares the object's pixels (height, width) with those whose points (height, width, 2) are in the rectangle.

    Raises:
        DetectionError: their overlap is below `minimum_overlap`.
    """
    rectangle = np.all(np.abs(places) < (sheet.width / 2, sheet.height / 2), axis=-1)
    overlap = np.count_nonzero(pixels & rectangle) / np.count_nonzero(pixels | rectangle)
    if overlap < minimum_overlap:
        raise DetectionError(
            f"the object is no rectangle: it has {overlap:.0%} in common with one of "
            f"{sheet.width:.3f} m × {sheet.height:.3f} m around it, "
            f"a sheet minimum_overlap = {minimum_overlap:g} at least"
        )

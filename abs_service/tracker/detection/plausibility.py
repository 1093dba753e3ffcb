"""Plausibility of a detected object: refuses impossible sizes, warns of a region that looks like the scene."""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Image
from abs_service.tracker.detection.image_alignment import alignment_warnings
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.mesh import Mesh, edge_lengths, pieces_of
from calib.formats.plausibility import MAX_BASELINE_M, baselines, is_turned
from calib.rig import Rig

#: Range of the extent of an object [m]; outside, the distances have the wrong unit.
MIN_M, MAX_M = 0.005, 20.0

#: The same for everything in sight, which is checked first: with the wrong unit, no region finds anything sensible.
MAX_SCENE_M = 200.0

#: Percentiles of the coordinates between which the extent is measured, because some pixels at the rim are wrong.
EXTENT_PERCENT = (2, 98)

#: Number of points for the extent; more are slower but not more accurate.
MAX_POINTS = 5000

#: A surface that spans the image is the scene if it has more than this share of the measured pixels, and of all.
SCENE_OF_MEASURED, SCENE_OF_IMAGE = 1 / 2, 1 / 3

#: Share of the width or height at each end that a surface may leave out and still span the image: structured light
#: sensors have no returns in the outer 7 % of an image that is registered to another camera.
SCENE_MARGIN = 0.08

#: Length along which a surface lines the image's border, in roots of its area: at most 1 if one side of the image cuts
#: off a thing as deep as wide; 1.25 to 4 times for the walls and floors of real scenes.
LINING = 1.2

#: Depth below the border of all that is measured at which the length along it is counted [px]: surfaces end inside.
BELOW_BORDER_PX = 6

#: A mesh leaves out what it should not if more than this share of the object's pixels lie farther beside its faces than
#: two vertices are apart: faces end at most that far inside an edge.
LEFT_OUT = 0.05

#: A principal point that is farther from the middle than this share of the image's width or height is that of another
#: image size: lenses are centred to a few per cent, and half or twice the size moves it by 25 or 50 %.
MAX_DECENTRING = 0.2


class ExtentError(DetectionError):
    """Impossible extent of the object or of all in sight: the distances have the wrong unit, or the region is wrong."""


def check_extent(points: NDArray[np.float64], what: str, maximum: float, sensor: str) -> None:
    """Checks the diagonal of the bounding box of points (k, 3) [m], without the outermost ones.

    Args:
        points: the points; none is in order, because then the region has more to say.
        what: name in the message.
        maximum: largest possible diagonal [m].
        sensor: name of the sensor that measured them.

    Raises:
        ExtentError: the diagonal is impossible.
    """
    if not len(points):
        return
    low, high = np.percentile(points[:: len(points) // MAX_POINTS + 1], EXTENT_PERCENT, axis=0)
    extent = float(np.linalg.norm(high - low))
    if not MIN_M <= extent <= maximum:
        wide = f"{extent * 1e3:.2g} mm" if extent < 1 else f"{extent:.0f} m"
        raise ExtentError(
            f"{what} would be {wide} wide: is the depth scale right? The device, depth_scale of imported images or "
            f"sensors.{sensor}.depth.scale determines it"
        )


def is_scene(surface: NDArray[np.bool_], measured: NDArray[np.bool_]) -> bool:
    """True if a surface spans the image and is the larger part of it: everything in sight is connected.

    Args:
        surface: its pixels (height, width).
        measured: pixels (height, width) with a return.
    """
    pixels = np.count_nonzero(surface)
    if pixels <= SCENE_OF_MEASURED * np.count_nonzero(measured) or pixels <= SCENE_OF_IMAGE * surface.size:
        return False
    rows, columns = np.nonzero(surface)
    return _spans(columns, surface.shape[1]) or _spans(rows, surface.shape[0])


def border_length(surface: NDArray[np.bool_], measured: NDArray[np.bool_]) -> int:
    """Length [px] over which a surface lies along the image's border; 0 if it may be a thing that the image cuts off.

    It is that along the border of what is measured, where that is about the image's.

    Args:
        surface: its pixels (height, width).
        measured: pixels (height, width) with a return.
    """
    below = _below_border(surface, measured)
    length = int(np.count_nonzero((below > BELOW_BORDER_PX - 1) & (below <= BELOW_BORDER_PX)))
    return length if length > LINING * np.sqrt(np.count_nonzero(surface)) else 0


def at_border(surface: NDArray[np.bool_], measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) of a surface at the border of what is measured, where that is about the image's.

    Arguments as of `border_length`.
    """
    below = _below_border(surface, measured)
    return (below > 0) & (below <= BELOW_BORDER_PX)


def _below_border(surface: NDArray[np.bool_], measured: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Depth (height, width) [px] of a surface's pixels below the border of all that is measured; 0 elsewhere."""
    margin_y, margin_x = (round(SCENE_MARGIN * size) + BELOW_BORDER_PX for size in surface.shape)
    near = surface.copy()
    near[margin_y : surface.shape[0] - margin_y, margin_x : surface.shape[1] - margin_x] = False
    if not near.any():
        return np.zeros(surface.shape, np.float32)
    # The ends of the rows have the hull of all that is measured, which takes a hundred times as long.
    rows = np.flatnonzero(measured.any(axis=1))
    first, last = measured[rows].argmax(axis=1), surface.shape[1] - 1 - measured[rows, ::-1].argmax(axis=1)
    ends = np.concatenate([np.stack([first, rows], 1), np.stack([last, rows], 1)]).astype(np.int32)
    # Surrounded by one pixel, so that the image's border is an edge as well.
    hull = cv2.fillConvexPoly(np.zeros(np.add(surface.shape, 2), np.uint8), cv2.convexHull(ends + 1), 1)
    return np.where(near, cv2.distanceTransform(hull, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1], 0).astype(np.float32)


def doubts(detection: InitialDetection, mesh: Mesh, images: Mapping[str, Image], rig: Rig) -> tuple[str, ...]:
    """All doubts about an object that was found, the mesh that was made of it, and the cameras that show it."""
    return (
        warnings(detection)
        + noise_warnings(detection)
        + mesh_warnings(mesh)
        + left_out_warnings(detection, mesh)
        + camera_warnings(rig)
        + alignment_warnings(detection, images, rig)
    )


def camera_warnings(rig: Rig) -> tuple[str, ...]:
    """Doubts about cameras that no image is needed for: intrinsics of others, and poses in another unit."""
    cameras = {name: sensor.camera for name, sensor in rig.sensors.items()}
    found = [
        f"{pair.replace(', ', ' and ')} are {baseline.length:.1f} m apart: are their poses in metres?"
        for pair, baseline in baselines(cameras).items()
        if baseline.length > MAX_BASELINE_M
    ]
    for name, camera in cameras.items():
        what = f"the principal point of {name}, ({camera.cx:.0f}, {camera.cy:.0f}) px, is"
        if is_turned(camera):
            found.append(
                f"{what} in the middle of images of {camera.height} × {camera.width} pixels, not of {camera.width} × "
                f"{camera.height}: are cx and cy exchanged?"
            )
        elif max(abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5)) > MAX_DECENTRING:
            found.append(
                f"{what} far from the middle of its images of {camera.width} × {camera.height} pixels: are its "
                "intrinsics those of images of this size?"
            )
    return tuple(found)


def mesh_warnings(mesh: Mesh) -> tuple[str, ...]:
    """Doubts about a mesh that was made of an object: it should be one piece, unless a file says otherwise."""
    sizes = pieces_of(mesh.faces)[1]
    if mesh.is_complete or len(sizes) < 2:
        return ()
    shares = " and ".join(f"{size / sizes.sum():.0%}" for size in sorted(sizes, reverse=True))
    return (
        f"the mesh has {len(sizes)} pieces, of {shares} of its vertices: is something in front of the object, "
        "or another one in the region?",
    )


def left_out_warnings(detection: InitialDetection, mesh: Mesh) -> tuple[str, ...]:
    """Doubts about a mesh beside which much of the object lies, unless a file has it so: its parts are too narrow."""
    inside = np.isfinite(detection.distance)
    if mesh.is_complete or not inside.any():
        return ()
    free = np.ones(inside.shape, np.uint8)
    for corners in np.round(detection.camera.project(mesh.vertices)).astype(np.int32)[mesh.faces]:
        cv2.fillConvexPoly(free, corners, 0)
    spacing = np.sqrt(np.count_nonzero(inside) / detection.vertices)
    left_out = inside & (cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5) > spacing + 1)
    share = np.count_nonzero(left_out) / np.count_nonzero(inside)
    if share <= LEFT_OUT:
        return ()
    apart = float(np.median(edge_lengths(mesh.vertices, mesh.edges)))
    return (
        f"{share:.0%} of what was found lie beside the mesh, whose vertices are {apart * 1e3:.0f} mm apart: narrow "
        "parts are not tracked – give the mesh more vertices, or leave these parts out by a mask",
    )


def noise_warnings(detection: InitialDetection) -> tuple[str, ...]:
    """Doubts about the noise model of the distances, if it is not the one in use, or about their unit."""
    if detection.fitting_scale != 1:
        factor = "ten times" if detection.fitting_scale < 1 else "a tenth of"
        return (
            f"distances scatter as if they were {factor} the true ones, by the sensor's noise model: is the depth "
            "scale right? The device, depth_scale of imported images or the sensor's depth.scale determines it; "
            "if it is, the noise model is another sensor's",
        )
    if detection.noise_scale == 1:
        return ()
    return (
        f"distances scatter by {detection.deviation * 1e3:.1f} mm about flat things as far away as the object, and not "
        f"by {detection.deviation / detection.noise_scale * 1e3:.1f} mm, as the sensor's noise model says: all its "
        f"deviations are taken {detection.noise_scale:.1f} times as large – measure the noise by abs-service calibrate "
        "noise",
    )


def warnings(detection: InitialDetection) -> tuple[str, ...]:
    """Doubts about an object that was found, in plain words, for `check`, health and the state alike."""
    inside, measured = np.isfinite(detection.distance), np.isfinite(detection.surroundings)
    if not measured.size:
        return ()
    if is_scene(inside, measured):
        return (
            f"the object fills {np.mean(inside):.0%} of the image, {inside.sum() / measured.sum():.0%} of all returns, "
            "from side to side: is the region right?",
        )
    if length := border_length(inside, measured):
        return (
            f"the object lies along {length} pixels of the image's border, like a wall or "
            "a floor: is the region right? A seed or a box would tell where the object is",
        )
    return ()


def _spans(places: NDArray[np.int64], size: int) -> bool:
    """True if columns or rows (k,) reach from one end of an image of this size to the other."""
    margin = SCENE_MARGIN * size
    return bool(places.min() <= margin and places.max() >= size - 1 - margin)

"""Detection of a strip held by a gripper, bent by its weight, in the first depth image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.detection.strip.elastica_fit import (
    MAX_GAP,
    NOISE_M,
    FittedElastica,
    Plane,
    Vector,
    find_plane,
    first_guess,
    fit,
    load_deviation,
    normals_at,
)
from abs_service.tracker.mesh import Mesh
from calib import pose
from calib.camera import Camera
from calib.pose import Pose

#: Minimum number of pixels for a fit, and the maximum that are used.
MIN_PIXELS, MAX_PIXELS = 100, 1500

#: Pixels farther beyond an end than this share of the length are outliers.
MAX_OVERHANG = 0.08

#: Minimum share of the pixels on one elastica for the object to be a strip.
MIN_SHARE = 0.7

#: Largest relative difference between the given and the detected length.
LENGTH_TOLERANCE = 0.2

#: Distance from the segmented pixels within which pixels may show the strip as well.
RIM_PX = 4

#: Quantile of the area at which the extent is measured and then extrapolated, because rims are ragged.
RIM_SHARE = 0.05

#: Lower bound of the cosine of incidence by which a pixel's area on the strip is divided. Mixed pixels at an end lie on
#: the curve's extrapolation, which may turn away from the camera: without the bound, their area lengthened the strip by
#: a fifth.
MIN_COSINE = 0.5


@dataclass(frozen=True, eq=False)
class Strip:
    """Pose, size and shape of a detected strip.

    Attributes:
        T_rg: pose of the gripper line: origin in its middle, x along the strip, y along the line, z the normal of the
            side that faces the sensor.
        length, width: free length from the gripper line to the other end, and width [m].
        turn: angle of the tangent relative to the gripper at the nodes (STEPS + 1,) from the gripper to the free end,
            positive towards z [rad].
        pixel: footprint of one of the sensor's pixels along the strip [m].
        load_deviation: standard deviation of the logarithm of the load that explains the shape; 0 if it is known.
    """

    T_rg: Pose
    length: float
    width: float
    turn: NDArray[np.float64]
    pixel: float
    load_deviation: float = 0.0

    def bends(self, segments: int) -> NDArray[np.float64]:
        """Bending angles (segments,) of equal parts of the strip, the first at the gripper [rad]."""
        nodes = np.linspace(0, 1, len(self.turn))
        return np.diff(np.interp(np.linspace(0, 1, segments + 1), nodes, self.turn))

    @property
    def length_deviation(self) -> float:
        """Standard deviation of the length and of the gripper's position along the strip [m]: about a pixel.

        Equal to the scatter of the ends in simulated images, where pixels mix strip and background.
        """
        return self.pixel

    def flat_mesh(self, vertices: int) -> Mesh:
        """A regular grid of about `vertices` vertices on the flattened strip; rows run along it."""
        T_gp = pose.from_rotation_vector((np.pi, 0, 0), (self.length / 2, 0, 0))
        return Sheet(self.T_rg @ T_gp, self.length, self.width).mesh(vertices)


def find_strip(detection: InitialDetection, gravity: Vector, towards_gripper: Vector, length: float = 0.0) -> Strip:
    """Fits a heavy elastica to the points of a strip, and its size to the edges.

    Args:
        detection: the segmented strip.
        gravity: unit vector (3,) in the rig.
        towards_gripper: vector (3,) in the rig from the free end towards the held one.
        length: free length [m]; 0 uses the detected length.

    Raises:
        DetectionError: too little is visible, or the object is not a strip.
    """
    seen = detection.points
    if len(seen) < MIN_PIXELS:
        raise DetectionError(f"the strip is too small in the depth image: {len(seen)} pixels, {MIN_PIXELS} needed")
    seen = seen[:: -(-len(seen) // MAX_PIXELS)]
    plane = find_plane(seen, gravity)
    elastica = first_guess(plane.coordinates(seen)[1], np.array([plane.ahead, plane.down]) @ towards_gripper)
    points = np.concatenate([seen, detection.beside(RIM_PX)])
    fitted = _Fitted(plane, elastica, np.arange(len(points)) < len(seen), (0.0, 0.0), False, 0.0)
    for _ in range(5):
        fitted = _refine(fitted, points, detection.camera)
    share = float(np.mean(fitted.belongs[: len(seen)]))
    _check((fitted.elastica.length, fitted.sides[1] - fitted.sides[0]), length, share)
    elastica = fitted.elastica.cut(fitted.elastica.length - (length or fitted.elastica.length), fitted.elastica.length)
    flat = fitted.plane.coordinates(points)[1][fitted.belongs]
    along = elastica.unroll(flat)[0]
    # Pixels at an end mix strip and background, and would distort the fitted shape most.
    inner = flat[np.minimum(along, elastica.length - along) > fitted.pixel / 2]
    elastica = fit(elastica, inner)
    return _strip(fitted, elastica, load_deviation(elastica, inner))


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Intermediate state of the iterative fit of a strip.

    Attributes:
        plane: plane of bending.
        elastica: shape of the visible part, from end to end.
        belongs: inlier mask (n,) of the points.
        sides: smallest and largest coordinate across [m].
        faces: True if the camera is on the side of the plane's normals.
        pixel: footprint of a pixel along the strip [m].
    """

    plane: Plane
    elastica: FittedElastica
    belongs: NDArray[np.bool_]
    sides: tuple[float, float]
    faces: bool
    pixel: float


def _refine(before: _Fitted, points: NDArray[np.float64], camera: Camera) -> _Fitted:
    """One iteration that fits shape, outline and plane to points (n, 3), one after the other."""
    plane, sight = before.plane, points - camera.center
    across, flat = plane.coordinates(points)
    elastica = fit(before.elastica, flat[before.belongs])
    along, gap, phi = elastica.unroll(flat)
    beyond = np.abs(along - elastica.length / 2) - elastica.length / 2
    belongs = (np.abs(gap) < MAX_GAP * NOISE_M) & (beyond < MAX_OVERHANG * elastica.length)
    normals = plane.normals(phi)
    high, wide = (size[belongs] for size in _pixel_sizes(sight, normals, camera.fx))
    across, along, gap, phi = across[belongs], along[belongs], gap[belongs], phi[belongs]
    first, last = _extent(along, high, wide)
    left, right = _extent(across, wide, high)
    tilt = _tilt(across - (left + right) / 2, along - (first + last) / 2, gap, phi)
    faces = bool(np.mean(np.sum(normals * sight, axis=1)[belongs] < 0) > 0.5)
    pixel = float(np.median(high))
    return _Fitted(plane.tilted(tilt), elastica.cut(first, last), belongs, (left, right), faces, pixel)


def _check(size: tuple[float, float], length: float, share: float) -> None:
    """Checks size and inlier share of a fitted strip.

    Raises:
        DetectionError: it is wider than long, not of the given length [m] (0: not given), or not an elastica.
    """
    if share < MIN_SHARE:
        raise DetectionError(
            f"the object hangs like no strip: {share:.0%} of it lie on one curve, {MIN_SHARE:.0%} needed"
        )
    if size[1] > size[0]:
        raise DetectionError(f"the object is no strip: it is {size[0]:.3f} m long, but {size[1]:.3f} m wide")
    if length and abs(size[0] / length - 1) > LENGTH_TOLERANCE:
        raise DetectionError(
            f"the strip in sight is {size[0]:.3f} m long, which differs by more than {LENGTH_TOLERANCE:.0%} from "
            f"length_m = {length:g}"
        )


def _pixel_sizes(sight: NDArray[np.float64], normals: NDArray[np.float64], focal: float) -> tuple[Vector, Vector]:
    """Footprint (n,) of each pixel along and across the strip [m]; `sight` points from the camera to the points."""
    distance = np.linalg.norm(sight, axis=1)
    cosine = np.abs(np.sum(normals * sight, axis=1)) / distance
    return distance / focal / np.maximum(cosine, MIN_COSINE), distance / focal


def _extent(coordinate: Vector, size: Vector, other_size: Vector) -> tuple[float, float]:
    """Smallest and largest coordinate of a rectangle, extrapolated from quantiles of its area.

    Mixed pixels at the rim have been excluded, which removes half a pixel on average; it is added again.

    Args:
        coordinate: coordinate of the pixels (n,) [m].
        size, other_size: footprint of the pixels in that direction and the other one (n,) [m].
    """
    order = np.argsort(coordinate)
    area = (size * other_size)[order]
    share = (np.cumsum(area) - 0.5 * area) / area.sum()
    inner = np.interp([RIM_SHARE, 1 - RIM_SHARE], share, coordinate[order])
    rim = (inner[1] - inner[0]) * RIM_SHARE / (1 - 2 * RIM_SHARE)
    half = 0.5 * np.interp([RIM_SHARE, 1 - RIM_SHARE], share, size[order])
    return float(inner[0] - rim - half[0]), float(inner[1] + rim + half[1])


def _tilt(across: Vector, along: Vector, gap: Vector, phi: Vector) -> NDArray[np.float64]:
    """Correction (2,) of the gripper line's direction, ahead and down.

    A wrong direction causes residuals normal to the curve in proportion to the coordinate across; a rotation in the
    strip's own plane causes skew of the outline.
    """
    normals = normals_at(phi)
    tangent = np.array([np.cos(np.median(phi)), np.sin(np.median(phi))])
    y, s = across - across.mean(), along - along.mean()
    wide, long, skew = np.mean(y * y), np.mean(s * s), np.mean(y * s)
    turn = skew * (wide - long) / ((wide - long) ** 2 + (0.1 * (wide + long)) ** 2)
    weight = np.sqrt(len(y) * wide)
    rows = np.vstack([normals * y[:, None], weight * tangent])
    return np.linalg.lstsq(rows, np.append(gap - gap.mean(), weight * turn), rcond=None)[0]


def _strip(fitted: _Fitted, elastica: FittedElastica, deviation: float) -> Strip:
    """The strip in rig coordinates, its z axis towards the camera."""
    plane, sides = fitted.plane, fitted.sides
    start = elastica.inclination[:1]
    sign = 1.0 if fitted.faces else -1.0
    z = sign * plane.normals(start)[0]
    x = np.cos(start) * plane.ahead + np.sin(start) * plane.down
    T_rg = np.eye(4)
    T_rg[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T_rg[:3, 3] = elastica.nodes[0] @ np.array([plane.ahead, plane.down]) + np.mean(sides) * plane.across
    return Strip(
        T_rg, elastica.length, sides[1] - sides[0], sign * (elastica.inclination - start), fitted.pixel, deviation
    )

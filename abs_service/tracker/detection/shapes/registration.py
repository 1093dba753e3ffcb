"""Registration of a known surface with the first depth image: its pose from the points in sight.

A robust iterative closest point method (ICP) from many starts. Every point of the object is drawn onto the tangential
plane of the nearest sample of the surface that faces the camera (Chen and Medioni, 1992), or onto the sample itself if
it lies beside the surface. And every sample that lies before the background is drawn onto the nearest point of the
object: the camera would have seen it. Occluded points are ignored, so the object may be partly occluded.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import at_points
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.segments.neighbourhood import grown
from abs_service.tracker.detection.shapes.principal_axes import extents, principal_axes
from abs_service.tracker.detection.shapes.samples import Samples
from calib import pose
from calib.camera import Camera
from calib.pose import Pose

Points = NDArray[np.float64]

#: Stages of the fit: number of points and of samples, of steps, and of the best poses that go on to the next stage.
STAGES = ((150, 4, 24), (150, 8, 5), (1200, 15, 5))

#: Poses whose rotations differ by less are the same [rad].
SAME_TURN = np.deg2rad(5.0)

#: Starts whose costs differ by less are alike, as those of a symmetric object: the most upright one is taken.
ALIKE = 1.03

#: Distance along the surface from the nearest sample, in spacings of the samples, beyond which a point lies beside it.
REACH = 1.1

#: Least distance of a sample from the background behind it: the larger of a length [m] and a number of σ.
MIN_GAP_M, GAP_DEVIATIONS = 0.01, 3.0

#: Width of the rim that a segmented object lacks [px].
RIM_PX = 2

#: Largest error (root mean square of the best 90 %) of a good fit: the larger of a length [m] and a number of σ.
MIN_ERROR_M, ERROR_DEVIATIONS = 0.004, 2.0
#: … or if a larger share of the object lies beside the template, or of the template before the background.
MAX_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Scene:
    """The first depth image as the registration needs it.

    Attributes:
        points: some points (k, 3) of the object [m].
        tree: for the nearest of them.
        camera: the depth camera.
        background: distance (height, width) [m] of the scene around the object; infinite where nothing is seen and most
            of the surroundings is empty, NaN where it is unknown, and on and next to the object.
        gap: see `MIN_GAP_M` [m].
        scale: size of an error from which on it counts linearly instead of squared [m].
    """

    points: Points
    tree: "scipy.spatial.KDTree"
    camera: Camera
    background: NDArray[np.floating]
    gap: float
    scale: float

    def thinned(self, count: int) -> "Scene":
        """The same scene with about so many points."""
        points = self.points[np.random.default_rng(0).permutation(len(self.points))[:count]]
        return Scene(points, scipy.spatial.KDTree(points), self.camera, self.background, self.gap, self.scale)


@dataclass(frozen=True, eq=False)
class Match:
    """Linearised errors of one pose, and their parts.

    Attributes:
        residual: (m,) [m].
        jacobian: their derivatives (m, 6) by a small rotation about the rig's origin and a translation.
        weight: of their squares (m,).
        cost: robust sum.
        errors: distances (j,) of points from the surface that they lie on [m].
        beside: share of the points that lie beside the surface.
        before: share of the samples facing the camera that lie before the background.
    """

    residual: Points
    jacobian: Points
    weight: Points
    cost: float
    errors: Points
    beside: float
    before: float


def register(samples: Samples, detection: InitialDetection) -> Pose:
    """Pose T_ro of a surface in the first depth image.

    Raises:
        DetectionError: the surface does not fit the object in sight.
    """
    scene = _scene(detection)
    poses, costs, thinned = _starts(scene, samples), [0.0], (scene, samples)
    for count, steps, best in STAGES:
        thinned = scene.thinned(count), samples.thinned(count)
        fits = sorted((_fitted(*thinned, T_ro, steps) for T_ro in poses), key=lambda fit: fit[1])
        fits = _distinct(fits)[:best]
        poses, costs = [T_ro for T_ro, _ in fits], [cost for _, cost in fits]
    alike = [T_ro for T_ro, cost in zip(poses, costs) if cost <= ALIKE * costs[0]]
    T_ro = min(alike, key=lambda T_ro: _turn(scene.camera, T_ro))
    _check(_match(*thinned, T_ro), samples, scene, detection.deviation)
    return T_ro


def registration_deviation(samples: Samples) -> float:
    """Standard deviation of the place of a registered surface along itself [m].

    Points that lie beside the surface by less than `REACH` draw on nothing, so that every place within it is alike.
    """
    return REACH * samples.thinned(STAGES[-1][0]).spacing / np.sqrt(3)


def _distinct(fits: list[tuple[Pose, float]]) -> list[tuple[Pose, float]]:
    """Poses with their costs, the best first, without those whose rotation is about that of a better one."""
    kept: list[tuple[Pose, float]] = []
    for T_ro, cost in fits:
        if all(np.trace(other[:3, :3].T @ T_ro[:3, :3]) < 1 + 2 * np.cos(SAME_TURN) for other, _ in kept):
            kept.append((T_ro, cost))
    return kept


def _scene(detection: InitialDetection) -> Scene:
    camera, distance, deviation = detection.camera, detection.distance, detection.deviation
    on = np.isfinite(distance)
    near = grown(on, RIM_PX)
    around = detection.surroundings if detection.surroundings.size else np.full_like(distance, np.nan)
    is_empty = np.count_nonzero(np.isnan(around[~near])) > np.count_nonzero(~near) / 2
    background = np.where(np.isnan(around), np.inf if is_empty else np.nan, around)
    gap, scale = max(MIN_GAP_M, GAP_DEVIATIONS * deviation), max(MIN_ERROR_M, deviation)
    points, tree = detection.points, scipy.spatial.KDTree(detection.points)
    return Scene(points, tree, camera, np.where(near, np.nan, background), gap, scale)


def _starts(scene: Scene, samples: Samples) -> list[Pose]:
    """Poses in which the principal axes of surface and points coincide in every way, and others between them."""
    center, axes = principal_axes(scene.points)
    own = principal_axes(samples.points)[1]
    turns = np.concatenate([scipy.spatial.transform.Rotation.create_group(group).as_matrix() for group in ("O", "I")])
    return [_centred(axes @ turn @ own.T, center, scene.camera, samples) for turn in turns]


def _centred(R: Points, center: Points, camera: Camera, samples: Samples) -> Pose:
    """The pose of a rotation (3, 3) with the samples that face the camera around a point (3,)."""
    points, normals = samples.points @ R.T, samples.normals @ R.T
    middle = points.mean(axis=0)
    if samples.is_closed:
        facing = normals @ (center - camera.center) < 0
        middle = points[facing].mean(axis=0) if facing.any() else middle
    T_ro = np.eye(4)
    T_ro[:3, :3], T_ro[:3, 3] = R, center - middle
    return T_ro


def _fitted(scene: Scene, samples: Samples, T_ro: Pose, steps: int) -> tuple[Pose, float]:
    """The pose after so many Gauss–Newton steps, and its cost."""
    for _ in range(steps):
        match = _match(scene, samples, T_ro)
        weighted = match.jacobian.T * match.weight
        curvature = weighted @ match.jacobian
        damping = 1e-6 * np.trace(curvature) * np.eye(6)
        step = -np.linalg.solve(curvature + damping, weighted @ match.residual)
        moved = pose.from_rotation_vector(step[:3], T_ro[:3, 3] + step[3:])
        moved[:3, :3] = moved[:3, :3] @ T_ro[:3, :3]
        T_ro = moved
    return T_ro, _match(scene, samples, T_ro).cost


def _match(scene: Scene, samples: Samples, T_ro: Pose) -> Match:
    """The errors of a pose."""
    surface, normals = pose.transform(T_ro, samples.points), samples.normals @ T_ro[:3, :3].T
    sight = surface - scene.camera.center
    facing = np.einsum("ni,ni->n", normals, sight) < 0
    if samples.is_closed and facing.any():  # none: the camera would be inside the object
        surface, normals, sight = surface[facing], normals[facing], sight[facing]
    nearest = scipy.spatial.KDTree(surface).query(scene.points)[1]
    feet, normals = surface[nearest], normals[nearest]
    gaps = feet - scene.points
    along = np.einsum("ni,ni->n", gaps, normals)
    beside = np.linalg.norm(gaps - along[:, None] * normals, axis=1) > REACH * samples.spacing
    behind = at_points(scene.background, scene.camera, surface)
    before = behind - np.linalg.norm(sight, axis=1) > scene.gap  # False for NaN
    strays = surface[before]
    astray = strays - scene.points[scene.tree.query(strays)[1]] if len(strays) else strays
    center, each = T_ro[:3, 3], 1 / len(scene.points)
    rows = (
        _rows(feet[~beside] - center, normals[~beside, None], along[~beside, None], scene.scale, each),
        _rows(feet[beside] - center, np.eye(3)[None], gaps[beside], scene.scale, each),
        _rows(strays - center, np.eye(3)[None], astray, scene.scale, 1 / len(surface)),
    )
    residual, jacobian, weight, costs = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    errors, shares = np.abs(along[~beside]), (float(np.mean(beside)), float(np.mean(before)))
    return Match(residual, jacobian, weight, float(costs.sum()), errors, *shares)


def _rows(
    arms: Points, directions: Points, gaps: Points, scale: float, share: float
) -> tuple[Points, Points, Points, Points]:
    """Residuals, Jacobian, weights and costs of gaps (k, d) [m] of points along unit directions (k or 1, d, 3).

    Huber's cost: half the square of a gap's length up to `scale`, linear beyond.

    Args:
        arms: from the origin of the object to the points (k, 3) [m].
        directions, gaps: see above.
        scale: [m].
        share: factor of all costs.
    """
    (a, b, c), (d, e, f) = arms.T[..., None], np.moveaxis(directions, 2, 0)
    jacobian = np.empty((*gaps.shape, 6))
    # The cross product, column by column: `np.cross` takes four times as long for so few.
    jacobian[..., 0], jacobian[..., 1], jacobian[..., 2] = b * f - c * e, c * d - a * f, a * e - b * d
    jacobian[..., 3:] = directions
    length = np.linalg.norm(gaps, axis=1)
    weight = share / np.maximum(length / scale, 1)
    cost = share * scale * np.where(length < scale, length**2 / (2 * scale), length - scale / 2)
    return gaps.reshape(-1), jacobian.reshape(-1, 6), np.repeat(weight, gaps.shape[1]), cost


def _turn(camera: Camera, T_ro: Pose) -> float:
    """Angle [rad] of the object's rotation relative to the camera."""
    return float(np.linalg.norm(pose.to_rotation_vector(camera.T_sr @ T_ro)[0]))


def _check(match: Match, samples: Samples, scene: Scene, deviation: float) -> None:
    """DetectionError if the surface does not fit."""
    errors = np.sort(match.errors)[: max(int(0.9 * len(match.errors)), 1)]
    error = float(np.sqrt(np.mean(errors**2))) if len(errors) else np.inf
    limit = max(MIN_ERROR_M, ERROR_DEVIATIONS * deviation)
    if error <= limit and max(match.beside, match.before) <= MAX_SHARE:
        return
    raise DetectionError(
        f"the template does not fit the object in sight, which measures {extents(scene.points)}, the template "
        f"{extents(samples.points)}: it is {error * 1e3:.1f} mm away (root mean square, {limit * 1e3:.1f} mm allowed), "
        f"{match.beside:.0%} of the object lie beside it, and {match.before:.0%} of it would hide what is seen of the "
        f"background ({MAX_SHARE:.0%} allowed)"
    )

"""Uncertainty of projections: in one sensor's image, and from one sensor's image to another's.

Covariances of intrinsics alone say little about projections, because a shift of the principal point is nearly a
rotation of the camera, and a longer focal length nearly a greater distance; only their sum is determined. Therefore the
small rigid motion of the camera that best compensates a change of projection over the volume of the boards is
subtracted (the implied transformation of J. Chen's mrcal). Between sensors nothing is subtracted, because their
relative pose is part of the result.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.solve.bundle import rotations
from calib.solve.bundle.blocks import by_intrinsics, directions_by_intrinsics
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, POSE, FreeParameters, Layout
from calib.solve.bundle.parameters.lens_parameters import MATRIX
from calib.solve.bundle.parameters.state import State
from calib.solve.solution import Solution
from calib.solve.validation.support import supported

#: Grid points across and down the image.
GRID = (15, 11)


@dataclass(frozen=True)
class UncertaintyMap:
    """Standard deviation of projections over an image.

    Attributes:
        pixels: grid points (rows, columns, 2) [px].
        deviations: along the worst direction (rows, columns) [px]; NaN where nothing can be projected.
        inside: True where boards were seen (rows, columns); elsewhere the lens is extrapolated.
    """

    pixels: NDArray[np.float64]
    deviations: NDArray[np.float64]
    inside: NDArray[np.bool_]

    @property
    def rms(self) -> float:
        """Root mean square where boards were seen [px]; NaN without such points."""
        return rms(self.deviations[self.inside])


def grid(camera: Camera, shape: tuple[int, int] = GRID) -> NDArray[np.float64]:
    """Regular grid of pixels including the border (rows, columns, 2)."""
    columns = np.linspace(0, camera.width - 1, shape[0])
    rows = np.linspace(0, camera.height - 1, shape[1])
    return np.stack(np.meshgrid(columns, rows), axis=-1)


def reach(solution: Solution, sensor: str) -> tuple[float, float]:
    """5th and 95th percentile of the boards' distances from a sensor [m]."""
    camera = solution.cameras[sensor]
    seen = {view.shot for view in (*solution.task.corners, *solution.task.planes) if view.sensor == sensor}
    boards = [solution.boards[shot] for shot in seen if shot in solution.boards] or list(solution.boards.values())
    distances = [np.linalg.norm(camera.T_sr[:3] @ board[:, 3]) for board in boards]
    near, far = np.percentile(distances, (5, 95)).tolist()
    return near, far


def image_uncertainty(solution: Solution, sensor: str, distance: float) -> UncertaintyMap:
    """Uncertainty of a sensor's projection at a distance [m]."""
    camera = solution.cameras[sensor]
    pixels = grid(camera)
    layout = solution.adjustment.layout
    changes = implied_jacobian(solution, sensor, distance)
    inside = supported(solution, sensor, pixels.reshape(-1, 2)).reshape(pixels.shape[:2])
    columns = layout.columns(sensor, layout.free_parameters[sensor].intrinsics)
    deviations = max_deviation(changes, solution.covariance[np.ix_(columns, columns)])
    return UncertaintyMap(pixels, deviations.reshape(inside.shape), inside)


def implied_jacobian(solution: Solution, sensor: str, distance: float) -> NDArray[np.float64]:
    """Compensated Jacobian (n, 2, k) of the grid at a distance [m] with respect to the free intrinsics of a sensor."""
    camera = solution.cameras[sensor]
    free = solution.adjustment.layout.free_parameters[sensor]
    near, far = reach(solution, sensor)
    volume = _points(camera, (near, 0.5 * (near + far), far))
    seen = np.tile(supported(solution, sensor, grid(camera).reshape(-1, 2)), 3)
    volume = volume[seen & np.isfinite(volume).all(axis=1)]
    changes = free.of_intrinsics(by_intrinsics(camera, volume[:, :2] / volume[:, 2:]), camera)
    points = _points(camera, (distance,))
    own = free.of_intrinsics(by_intrinsics(camera, points[:, :2] / points[:, 2:]), camera)
    return MotionCompensation(camera, volume).at(points, changes, own)


@dataclass(frozen=True)
class MotionCompensation:
    """Subtracts the best compensating rigid motion of the camera from changes of a projection.

    Attributes:
        camera: the camera.
        volume: points that determine the motion (m, 3) [m], in the sensor's frame.
    """

    camera: Camera
    volume: NDArray[np.float64]

    def at(
        self, points: NDArray[np.float64], in_volume: NDArray[np.float64], changes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Compensated changes (n, 2, k) at points (n, 3), given the changes in the volume (m, 2, k)."""
        count = in_volume.shape[-1]
        motions, *_ = np.linalg.lstsq(
            self._by_motion(self.volume), in_volume.reshape(2 * len(self.volume), count), rcond=None
        )
        return changes - (self._by_motion(points) @ motions).reshape(len(points), 2, count)

    def _by_motion(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Jacobian (2 n, 6) of projections with respect to a small rotation and translation of the points."""
        alone = replace(self.camera, T_rs=pose.identity())
        by_point = alone.projection_jacobian(points)
        return np.concatenate([by_point @ -rotations.cross(points), by_point], axis=-1).reshape(-1, 6)


def pair_uncertainty(solution: Solution, source: str, target: str, distance: float) -> UncertaintyMap:
    """Uncertainty [px] in the target's image of points that a depth sensor measures at a distance [m]."""
    pixels = grid(solution.cameras[source])
    changes = pair_jacobian(solution.state, solution.adjustment.layout, source, target, distance)
    columns = pair_columns(solution.adjustment.layout, source, target)
    deviations = max_deviation(changes, solution.covariance[np.ix_(columns, columns)])
    inside = pair_support(solution, source, target, distance)
    return UncertaintyMap(pixels, deviations.reshape(inside.shape), inside)


def pair_support(solution: Solution, source: str, target: str, distance: float) -> NDArray[np.bool_]:
    """Mask on the source's grid (rows, columns) of points where both sensors saw boards."""
    pixels = grid(solution.cameras[source])
    flat = pixels.reshape(-1, 2)
    there = map_pixels(solution.state, source, target, flat, distance)
    return (supported(solution, source, flat) & supported(solution, target, there)).reshape(pixels.shape[:2])


def pair_columns(layout: Layout, source: str, target: str) -> NDArray[np.intp]:
    """Columns of the parameters on which the mapping between two sensors depends."""
    return np.concatenate([layout.columns(name, layout.free_parameters[name].names) for name in (source, target)])


def pair_jacobian(state: State, layout: Layout, source: str, target: str, distance: float) -> NDArray[np.float64]:
    """Jacobian (n, 2, k) of `map_pixels` on the source's grid with respect to the parameters of `pair_columns`."""
    sensor, camera = state.sensors[source], state.sensors[target].camera
    directions = viewing_directions(sensor.camera, grid(sensor.camera).reshape(-1, 2))
    true = (distance - sensor.depth_offset) / (1 + sensor.depth_scale)
    points_r = pose.transform(sensor.camera.T_rs, directions * true)
    points_t = pose.transform(camera.T_sr, points_r)
    by_point = camera.projection_jacobian(points_r)
    turn = sensor.camera.T_rs[:3, :3]
    lengths = np.stack([np.ones_like(directions), directions * true], axis=-1)
    lengths[..., 0] = directions
    by_source = np.concatenate(
        [
            by_point @ turn @ directions_by_intrinsics(sensor.camera, directions) * true,
            by_point @ -rotations.cross(points_r - sensor.camera.center),
            by_point,
            by_point @ turn @ (-lengths / (1 + sensor.depth_scale)),
            np.zeros((len(directions), 2, 1)),
        ],
        axis=-1,
    )
    by_target = np.concatenate(
        [
            by_intrinsics(camera, points_t[:, :2] / points_t[:, 2:]),
            by_point @ rotations.cross(points_r - camera.center),
            -by_point,
            np.zeros((len(directions), 2, 3)),
        ],
        axis=-1,
    )
    own = _by_free(by_source, layout.free_parameters[source], sensor.camera)
    return np.concatenate([own, _by_free(by_target, layout.free_parameters[target], camera)], axis=-1)


def _by_free(derivatives: NDArray[np.float64], free: FreeParameters, camera: Camera) -> NDArray[np.float64]:
    """Derivatives (n, 2, k) by a sensor's free parameters, from those by all possible ones."""
    every = [*MATRIX, *free.kind.every, *POSE, *DEPTH_TERMS, "time_offset"]
    others = [every.index(name) for name in free.names[len(free.intrinsics) :]]
    return np.concatenate([free.of_intrinsics(derivatives, camera), derivatives[:, :, others]], axis=-1)


def map_pixels(
    state: State, source: str, target: str, pixels: NDArray[np.float64], distance: float
) -> NDArray[np.float64]:
    """Pixels (n, 2) in the target of points that the source measures at pixels (n, 2) and a radial distance [m].

    NaN for points behind the target or more than half an image outside its image.
    """
    sensor = state.sensors[source]
    true = (distance - sensor.depth_offset) / (1 + sensor.depth_scale)
    camera = state.sensors[target].camera
    found = camera.project(pose.transform(sensor.camera.T_rs, viewing_directions(sensor.camera, pixels) * true))
    size = np.array([camera.width, camera.height])
    with np.errstate(invalid="ignore"):
        found[np.any((found < -0.5 * size) | (found > 1.5 * size), axis=1)] = np.nan
    return found


def viewing_directions(camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit viewing directions (n, 3) of pixels (n, 2); NaN where the fitted lens has no inverse."""
    ideal = camera.lens.inverse((pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy))
    directions = np.concatenate([ideal, np.ones((len(pixels), 1))], axis=1)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def max_deviation(changes: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest standard deviation over directions (n,) of points with Jacobians (n, 2, k)."""
    blocks = changes @ covariance @ changes.transpose(0, 2, 1)
    half = (blocks[:, 0, 0] + blocks[:, 1, 1]) / 2
    swing = np.hypot((blocks[:, 0, 0] - blocks[:, 1, 1]) / 2, blocks[:, 0, 1])
    return np.sqrt(np.maximum(half + swing, 0))


def total_deviation(changes: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root of the summed variances of both coordinates (n,): expected length of an error."""
    return np.sqrt(np.maximum(np.einsum("nik,kl,nil->n", changes, covariance, changes), 0))


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square of the finite values; NaN without any."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def _points(camera: Camera, distances: Sequence[float]) -> NDArray[np.float64]:
    """Points (n, 3) [m] in the sensor's frame on the rays of the grid, at each distance."""
    directions = viewing_directions(camera, grid(camera).reshape(-1, 2))
    return np.concatenate([directions * distance for distance in distances])

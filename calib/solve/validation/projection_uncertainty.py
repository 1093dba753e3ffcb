"""How well a calibration knows where a point appears: in one sensor's image, and from one sensor's image to another's.

Intrinsics alone say little about projections, since a shift of the principal point is nearly a turn of the camera, and
a longer focal length nearly a greater distance: a calibration determines the sum, and whoever uses it needs the sum.
What a small turn and displacement of the whole camera can undo is therefore taken out of every change of a projection:
the one that fits best over the volume in which the boards were (J. Chen's mrcal calls it the implied transformation).
From one sensor to another nothing is taken out; the poses between them are what is asked there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.solve.bundle import rotations
from calib.solve.bundle.blocks import by_intrinsics, directions_by_intrinsics
from calib.solve.bundle.layout import DEPTH_TERMS, POSE, Layout
from calib.solve.bundle.lens_parameters import MATRIX
from calib.solve.bundle.state import State
from calib.solve.solution import Solution
from calib.solve.validation.support import supported

#: Points across and down the image at which projections are compared.
GRID = (15, 11)


@dataclass(frozen=True)
class Field:
    """Deviation of projections over an image.

    Attributes:
        pixels: where (rows, columns, 2) [px].
        deviations: in the direction in which it is largest (rows, columns) [px]; NaN where nothing can be projected.
        inside: where boards were seen (rows, columns); elsewhere lenses are extrapolated.
    """

    pixels: NDArray[np.float64]
    deviations: NDArray[np.float64]
    inside: NDArray[np.bool_]

    @property
    def typical(self) -> float:
        """Root mean square where boards were seen [px]; NaN if no point can be projected there."""
        return rms(self.deviations[self.inside])


def grid(camera: Camera, shape: tuple[int, int] = GRID) -> NDArray[np.float64]:
    """Pixels evenly over an image, its border included (rows, columns, 2)."""
    columns = np.linspace(0, camera.width - 1, shape[0])
    rows = np.linspace(0, camera.height - 1, shape[1])
    return np.stack(np.meshgrid(columns, rows), axis=-1)


def reach(solution: Solution, sensor: str) -> tuple[float, float]:
    """Distances between which nine of ten boards were from a sensor [m]."""
    camera = solution.cameras[sensor]
    seen = {view.shot for view in (*solution.task.corners, *solution.task.planes) if view.sensor == sensor}
    boards = [solution.boards[shot] for shot in seen if shot in solution.boards] or list(solution.boards.values())
    distances = [np.linalg.norm(camera.T_sr[:3] @ board[:, 3]) for board in boards]
    near, far = np.percentile(distances, (5, 95)).tolist()
    return near, far


def in_image(solution: Solution, sensor: str, distance: float) -> Field:
    """How well a sensor's projection is known at a distance [m]."""
    camera = solution.cameras[sensor]
    pixels = grid(camera)
    layout = solution.adjustment.layout
    changes = implied_changes(solution, sensor, distance)
    inside = supported(solution, sensor, pixels.reshape(-1, 2)).reshape(pixels.shape[:2])
    columns = layout.columns(sensor, layout.freedoms[sensor].intrinsics)
    deviations = spread(changes, solution.covariance[np.ix_(columns, columns)])
    return Field(pixels, deviations.reshape(inside.shape), inside)


def implied_changes(solution: Solution, sensor: str, distance: float) -> NDArray[np.float64]:
    """Derivatives (n, 2, k) of projections on the grid, at a distance [m], by a sensor's free intrinsics."""
    camera = solution.cameras[sensor]
    freedom = solution.adjustment.layout.freedoms[sensor]
    order = [*MATRIX, *freedom.kind.coefficients]
    wanted = [order.index(name) for name in freedom.intrinsics]
    near, far = reach(solution, sensor)
    volume = _points(camera, (near, 0.5 * (near + far), far))
    seen = np.tile(supported(solution, sensor, grid(camera).reshape(-1, 2)), 3)
    volume = volume[seen & np.isfinite(volume).all(axis=1)]
    changes = by_intrinsics(camera, volume[:, :2] / volume[:, 2:])[:, :, wanted]
    points = _points(camera, (distance,))
    own = by_intrinsics(camera, points[:, :2] / points[:, 2:])[:, :, wanted]
    return Undone(camera, volume).at(points, changes, own)


@dataclass(frozen=True)
class Undone:
    """Takes out of changes of a projection what a small motion of the camera can undo.

    Attributes:
        camera: whose.
        volume: points that decide which motion (m, 3) [m], in the sensor's frame.
    """

    camera: Camera
    volume: NDArray[np.float64]

    def at(
        self, points: NDArray[np.float64], in_volume: NDArray[np.float64], changes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Changes (n, 2, k) at points (n, 3), given those in the volume (m, 2, k)."""
        count = in_volume.shape[-1]
        motions, *_ = np.linalg.lstsq(
            self._by_motion(self.volume), in_volume.reshape(2 * len(self.volume), count), rcond=None
        )
        return changes - (self._by_motion(points) @ motions).reshape(len(points), 2, count)

    def _by_motion(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives (2 n, 6) of projections by a small turn and displacement of the points."""
        alone = replace(self.camera, T_rs=pose.identity())
        by_point = alone.projection_jacobian(points)
        return np.concatenate([by_point @ -rotations.cross(points), by_point], axis=-1).reshape(-1, 6)


def between(solution: Solution, source: str, target: str, distance: float) -> Field:
    """How well is known where a depth sensor's point at a distance [m] appears in another sensor's image [px there]."""
    pixels = grid(solution.cameras[source])
    changes = pair_changes(solution.state, solution.adjustment.layout, source, target, distance)
    columns = pair_columns(solution.adjustment.layout, source, target)
    deviations = spread(changes, solution.covariance[np.ix_(columns, columns)])
    inside = pair_support(solution, source, target, distance)
    return Field(pixels, deviations.reshape(inside.shape), inside)


def pair_support(solution: Solution, source: str, target: str, distance: float) -> NDArray[np.bool_]:
    """Where on the source's grid (rows, columns) both sensors saw boards."""
    pixels = grid(solution.cameras[source])
    flat = pixels.reshape(-1, 2)
    there = mapped(solution.state, source, target, flat, distance)
    return (supported(solution, source, flat) & supported(solution, target, there)).reshape(pixels.shape[:2])


def pair_columns(layout: Layout, source: str, target: str) -> NDArray[np.intp]:
    """Parameters that say where a point of one sensor appears in another."""
    return np.concatenate([layout.columns(name, layout.freedoms[name].names) for name in (source, target)])


def pair_changes(state: State, layout: Layout, source: str, target: str, distance: float) -> NDArray[np.float64]:
    """Derivatives (n, 2, k) of `mapped` on the source's grid by the parameters of `pair_columns`."""
    sensor, camera = state.sensors[source], state.sensors[target].camera
    directions = sight(sensor.camera, grid(sensor.camera).reshape(-1, 2))
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
    return np.concatenate([by_source[:, :, _order(layout, source)], by_target[:, :, _order(layout, target)]], axis=-1)


def _order(layout: Layout, sensor: str) -> list[int]:
    """Where a sensor's free parameters are in the list of all that a sensor may have."""
    freedom = layout.freedoms[sensor]
    every = [*MATRIX, *freedom.kind.every, *POSE, *DEPTH_TERMS, "time_offset"]
    return [every.index(name) for name in freedom.names]


def mapped(state: State, source: str, target: str, pixels: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """Where points that a sensor measures at pixels (n, 2) and a radial distance [m] appear in another sensor (n, 2).

    NaN for those that are not in front of it, or not within half an image of its image.
    """
    sensor = state.sensors[source]
    true = (distance - sensor.depth_offset) / (1 + sensor.depth_scale)
    camera = state.sensors[target].camera
    found = camera.project(pose.transform(sensor.camera.T_rs, sight(sensor.camera, pixels) * true))
    size = np.array([camera.width, camera.height])
    with np.errstate(invalid="ignore"):
        found[np.any((found < -0.5 * size) | (found > 1.5 * size), axis=1)] = np.nan
    return found


def sight(camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit directions (n, 3) behind pixels (n, 2); NaN where the fitted lens has none, as in a corner nobody saw."""
    ideal = camera.lens.inverse((pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy))
    directions = np.concatenate([ideal, np.ones((len(pixels), 1))], axis=1)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def spread(changes: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest deviation (n,) of points whose derivatives by the parameters are (n, 2, k)."""
    blocks = changes @ covariance @ changes.transpose(0, 2, 1)
    half = (blocks[:, 0, 0] + blocks[:, 1, 1]) / 2
    swing = np.hypot((blocks[:, 0, 0] - blocks[:, 1, 1]) / 2, blocks[:, 0, 1])
    return np.sqrt(np.maximum(half + swing, 0))


def total_spread(changes: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root of the summed variances of both coordinates (n,): the expected length of an error."""
    return np.sqrt(np.maximum(np.einsum("nik,kl,nil->n", changes, covariance, changes), 0))


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square of what is a number; NaN if nothing is."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def _points(camera: Camera, distances: Sequence[float]) -> NDArray[np.float64]:
    """Points (n, 3) [m] in the sensor's frame behind the grid's pixels, at each distance."""
    directions = sight(camera, grid(camera).reshape(-1, 2))
    return np.concatenate([directions * distance for distance in distances])

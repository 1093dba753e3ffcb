"""All residuals of a calibration and their sparse Jacobian, as functions of increments of the parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from calib.camera import CameraError
from calib.lenses.lens import LensError
from calib.solve.bundle import motion, rotations
from calib.solve.bundle.blocks import Corners, JacobianBlocks, Planes
from calib.solve.bundle.motion import ShotPoses, ViewPoses
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, POSE, Layout
from calib.solve.bundle.parameters.state import SensorState, State

#: Sensors by their names.
Sensors = Mapping[str, SensorState]

#: Damping relative to the diagonal of the curvature, for the redundant parameters of a rational lens without
#: distortion.
DAMPING = 1e-10


@dataclass(frozen=True)
class Group:
    """Measurements of one sensor and one kind, with a common factor on their deviations.

    Attributes:
        sensor: name.
        measured: corners or distances, with views numbered from 0.
        shots: row of the shot of each view (views,), or pair of rows to interpolate between (views, 2).
        times: of the views on the sensor's clock (views,) [s]; used for interpolation.
    """

    sensor: str
    measured: Corners | Planes
    shots: NDArray[np.intp]
    times: NDArray[np.float64]

    @property
    def name(self) -> str:
        """Name in reports, such as `tof corners`."""
        return f"{self.sensor} {'corners' if isinstance(self.measured, Corners) else 'distances'}"

    @property
    def views_of_rows(self) -> NDArray[np.intp]:
        """Index of the view of every residual."""
        return np.repeat(self.measured.views, 2 if isinstance(self.measured, Corners) else 1)

    def rescaled(self, factor: float) -> "Group":
        """Copy with all deviations multiplied by a factor."""
        return replace(self, measured=replace(self.measured, sigmas=self.measured.sigmas * factor))


@dataclass(frozen=True)
class Equations:
    """Normalised residuals and their Jacobian.

    Attributes:
        layout: parameter vector.
        base: state to which increments are applied.
        groups: measurements; residuals are concatenated in this order.
        shot_times: times of the shots on the rig's clock (shots,) [s].
        poses: number of the distinct board pose that each shot shows (shots,).
    """

    layout: Layout
    base: State
    groups: Sequence[Group]
    shot_times: NDArray[np.float64]
    poses: NDArray[np.intp]

    def residuals(self, increments: NDArray[np.float64]) -> NDArray[np.float64]:
        """All residuals; infinite where the increments give an invalid camera or a board behind it."""
        try:
            sensors = self.layout.sensors(self.base, increments)
            boards = self._boards(increments)
            parts = [_residuals(group, sensors, self._placed(group, sensors, boards)) for group in self.groups]
        except (CameraError, LensError):
            return np.full(self.ends[-1] + len(self._regularized_columns), np.inf)
        return np.concatenate([*parts, self._regularized(sensors)])

    def jacobian(self, increments: NDArray[np.float64]) -> sparse.csr_array:
        """Sparse Jacobian of `residuals` with respect to the increments."""
        sensors = self.layout.sensors(self.base, increments)
        boards = self._boards(increments)
        blocks = [self._rows(group, sensors, boards, increments) for group in self.groups]
        count = len(self._regularized_columns)
        regularized = (1 / self._prior_sigmas, (np.arange(count), self._regularized_columns))
        return sparse.csr_array(
            sparse.vstack([*blocks, sparse.csr_array(regularized, shape=(count, self.layout.size))])
        )

    @cached_property
    def base_jacobian(self) -> sparse.csr_array:
        """`jacobian` without increments, which covariances and checks of a solution ask for again and again."""
        return self.jacobian(np.zeros(self.layout.size))

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """First residual of every group, and the total number."""
        return np.cumsum([0, *(len(group.views_of_rows) for group in self.groups)])

    @property
    def shots_of_rows(self) -> NDArray[np.intp]:
        """Row of the shot of every residual of the groups; of the first shot where poses are interpolated."""
        return np.concatenate(
            [group.shots.reshape(len(group.shots), -1)[group.views_of_rows, 0] for group in self.groups]
        )

    @cached_property
    def _regularized_columns(self) -> NDArray[np.intp]:
        """Columns of the regularised parameters."""
        columns = [self.layout.columns(name, [*free.priors]) for name, free in self.layout.free_parameters.items()]
        return np.concatenate(columns)

    @cached_property
    def _prior_sigmas(self) -> NDArray[np.float64]:
        return np.array([sigma for free in self.layout.free_parameters.values() for sigma in free.priors.values()])

    def _regularized(self, sensors: Sensors) -> NDArray[np.float64]:
        """Normalised values of the regularised parameters; appended to the residuals of the groups."""
        values = [
            getattr(sensors[name], each)
            if each in DEPTH_TERMS
            else sensors[name].camera.lens.coefficients[free.kind.every.index(each)]
            for name, free in self.layout.free_parameters.items()
            for each in free.priors
        ]
        return np.array(values) / self._prior_sigmas

    def slices(self) -> list[slice]:
        """Rows of every group."""
        return [slice(int(first), int(end)) for first, end in zip(self.ends[:-1], self.ends[1:], strict=True)]

    def _boards(self, increments: NDArray[np.float64]) -> ShotPoses:
        steps = increments[self.layout.board_start :].reshape(-1, 6)
        poses = np.stack([self.base.boards[shot] for shot in self.layout.shots])
        turned = rotations.exponential(steps[:, :3]) @ poses[:, :3, :3]
        left_jacobians = rotations.left_jacobian(steps[:, :3])
        return ShotPoses(turned, poses[:, :3, 3] + steps[:, 3:], left_jacobians, self.shot_times)

    def _placed(self, group: Group, sensors: Sensors, boards: ShotPoses) -> ViewPoses:
        if group.shots.ndim == 1:
            return motion.at_shots(boards, group.shots)
        return motion.between_shots(boards, group.shots, group.times + sensors[group.sensor].time_offset)

    def _rows(
        self, group: Group, sensors: Sensors, boards: ShotPoses, increments: NDArray[np.float64]
    ) -> sparse.csr_array:
        sensor = sensors[group.sensor]
        placed = self._placed(group, sensors, boards)
        if isinstance(group.measured, Corners):
            blocks = group.measured.jacobian_blocks(sensor.camera, placed)
        else:
            blocks = group.measured.jacobian_blocks(sensor.camera, placed, sensor.depth_scale)
        views = group.views_of_rows
        own, columns = self._of_sensor(group.sensor, blocks, placed.by_time[views], increments)
        of_board = np.einsum("ni,nmij->nmj", blocks.board, placed.by_shots[views]).reshape(len(views), -1)
        shots = self.layout.board_start + 6 * placed.shots[views][:, :, None] + np.arange(6)
        values = np.concatenate([own, of_board], axis=1)
        indices = np.concatenate([np.broadcast_to(columns, own.shape), shots.reshape(len(views), -1)], axis=1)
        starts = np.arange(len(views) + 1) * values.shape[1]
        return sparse.csr_array((values.ravel(), indices.ravel(), starts), shape=(len(views), self.layout.size))

    def _of_sensor(
        self, name: str, blocks: JacobianBlocks, by_time: NDArray[np.float64], increments: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Jacobian (n, k) with respect to the sensor's free parameters, and their columns (k,)."""
        free = self.layout.free_parameters[name]
        parts = [free.of_intrinsics(blocks.intrinsics, self.base.sensors[name].camera)]
        if free.moves:
            turn = increments[self.layout.columns(name, POSE[:3])]
            parts += [blocks.pose[:, :3] @ rotations.left_jacobian(turn[None])[0], blocks.pose[:, 3:]]
        parts.append(blocks.depth[:, [DEPTH_TERMS.index(each) for each in free.depth]])
        if free.free_running:
            parts.append(np.sum(blocks.board * by_time, axis=1, keepdims=True))
        return np.concatenate(parts, axis=1), self.layout.columns(name, free.names)


def _residuals(group: Group, sensors: Sensors, placed: ViewPoses) -> NDArray[np.float64]:
    sensor = sensors[group.sensor]
    if isinstance(group.measured, Corners):
        return group.measured.residuals(sensor.camera, placed)
    return group.measured.residuals(sensor.camera, placed, sensor.depth_offset, sensor.depth_scale)

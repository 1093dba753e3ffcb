"""All residuals of a calibration and their sparse Jacobian, as functions of the increments of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from calib.camera import CameraError
from calib.lens import LensError
from calib.solve.bundle import motion, rotations
from calib.solve.bundle.blocks import Corners, Derivatives, Planes
from calib.solve.bundle.layout import DEPTH_TERMS, POSE, Layout
from calib.solve.bundle.lens_parameters import HELD, MATRIX
from calib.solve.bundle.motion import Boards, Placed
from calib.solve.bundle.state import State


@dataclass(frozen=True)
class Group:
    """What one sensor measured in one way; its deviations share one factor.

    Attributes:
        sensor: name.
        measured: corners or distances; their views are numbered from 0.
        shots: rows of the shots of all views (views,), or pairs of rows between which they lie (views, 2).
        times: of the views on the sensor's clock (views,) [s]; used with pairs.
    """

    sensor: str
    measured: Corners | Planes
    shots: NDArray[np.intp]
    times: NDArray[np.float64]

    @property
    def name(self) -> str:
        """For reports: `tof corners`."""
        return f"{self.sensor} {'corners' if isinstance(self.measured, Corners) else 'distances'}"

    @property
    def views_of_rows(self) -> NDArray[np.intp]:
        """Number of the view of every residual."""
        return np.repeat(self.measured.views, 2 if isinstance(self.measured, Corners) else 1)

    def rescaled(self, factor: float) -> "Group":
        """The same with all deviations times a factor."""
        return replace(self, measured=replace(self.measured, sigmas=self.measured.sigmas * factor))


@dataclass(frozen=True)
class Equations:
    """Residuals in deviations and their derivatives.

    Attributes:
        layout: what the parameters are.
        base: state that they are increments of.
        groups: measurements; their residuals follow each other in this order.
        shot_times: of the shots on the rig's clock (shots,) [s].
    """

    layout: Layout
    base: State
    groups: Sequence[Group]
    shot_times: NDArray[np.float64]

    def residuals(self, increments: NDArray[np.float64]) -> NDArray[np.float64]:
        """All residuals; not finite where the increments describe no camera or put the board behind one."""
        try:
            state = self.layout.move(self.base, increments)
            boards = self._boards(increments)
            parts = [_residuals(group, state, self._placed(group, state, boards)) for group in self.groups]
        except (CameraError, LensError):
            return np.full(self.ends[-1] + len(self._held_columns), np.inf)
        return np.concatenate([*parts, self._held(state)])

    def jacobian(self, increments: NDArray[np.float64]) -> sparse.csr_array:
        """Derivatives of `residuals` by the increments."""
        state = self.layout.move(self.base, increments)
        boards = self._boards(increments)
        blocks = [self._rows(group, state, boards, increments) for group in self.groups]
        count = len(self._held_columns)
        held = (np.full(count, 1 / HELD), (np.arange(count), self._held_columns))
        return sparse.csr_array(sparse.vstack([*blocks, sparse.csr_array(held, shape=(count, self.layout.size))]))

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """First residual of every group, and the number of all."""
        return np.cumsum([0, *(len(group.views_of_rows) for group in self.groups)])

    @cached_property
    def _held_columns(self) -> NDArray[np.intp]:
        """Parameters that are held near zero."""
        held = [self.layout.columns(name, freedom.held) for name, freedom in self.layout.freedoms.items()]
        return np.concatenate(held)

    def _held(self, state: State) -> NDArray[np.float64]:
        """Values of those, in deviations; they follow the residuals of all groups."""
        values = [
            state.sensors[name].camera.lens.coefficients[freedom.kind.every.index(each)]
            for name, freedom in self.layout.freedoms.items()
            for each in freedom.held
        ]
        return np.array(values) / HELD

    def slices(self) -> list[slice]:
        """Residuals of every group."""
        return [slice(int(first), int(end)) for first, end in zip(self.ends[:-1], self.ends[1:], strict=True)]

    def _boards(self, increments: NDArray[np.float64]) -> Boards:
        steps = increments[self.layout.board_start :].reshape(-1, 6)
        poses = np.stack([self.base.boards[shot] for shot in self.layout.shots])
        turned = rotations.exponential(steps[:, :3]) @ poses[:, :3, :3]
        chains = rotations.left_jacobian(steps[:, :3])
        return Boards(turned, poses[:, :3, 3] + steps[:, 3:], chains, self.shot_times)

    def _placed(self, group: Group, state: State, boards: Boards) -> Placed:
        if group.shots.ndim == 1:
            return motion.at_shots(boards, group.shots)
        return motion.between_shots(boards, group.shots, group.times + state.sensors[group.sensor].time_offset)

    def _rows(self, group: Group, state: State, boards: Boards, increments: NDArray[np.float64]) -> sparse.csr_array:
        sensor = state.sensors[group.sensor]
        placed = self._placed(group, state, boards)
        if isinstance(group.measured, Corners):
            slopes = group.measured.derivatives(sensor.camera, placed)
        else:
            slopes = group.measured.derivatives(sensor.camera, placed, sensor.depth_scale)
        views = group.views_of_rows
        own, columns = self._of_sensor(group.sensor, slopes, placed.by_time[views], increments)
        of_board = np.einsum("ni,nmij->nmj", slopes.board, placed.by_shots[views]).reshape(len(views), -1)
        shots = self.layout.board_start + 6 * placed.shots[views][:, :, None] + np.arange(6)
        values = np.concatenate([own, of_board], axis=1)
        indices = np.concatenate([np.broadcast_to(columns, own.shape), shots.reshape(len(views), -1)], axis=1)
        starts = np.arange(len(views) + 1) * values.shape[1]
        return sparse.csr_array((values.ravel(), indices.ravel(), starts), shape=(len(views), self.layout.size))

    def _of_sensor(
        self, name: str, slopes: Derivatives, by_time: NDArray[np.float64], increments: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Derivatives (n, k) by the sensor's own parameters and their columns (k,)."""
        freedom = self.layout.freedoms[name]
        order = [*MATRIX, *freedom.kind.coefficients]
        parts = [slopes.intrinsics[:, [order.index(each) for each in freedom.intrinsics]]]
        if freedom.moves:
            turn = increments[self.layout.columns(name, POSE[:3])]
            parts += [slopes.pose[:, :3] @ rotations.left_jacobian(turn[None])[0], slopes.pose[:, 3:]]
        parts.append(slopes.depth[:, [DEPTH_TERMS.index(each) for each in freedom.depth]])
        if freedom.runs_free:
            parts.append(np.sum(slopes.board * by_time, axis=1, keepdims=True))
        return np.concatenate(parts, axis=1), self.layout.columns(name, freedom.names)


def _residuals(group: Group, state: State, placed: Placed) -> NDArray[np.float64]:
    sensor = state.sensors[group.sensor]
    if isinstance(group.measured, Corners):
        return group.measured.residuals(sensor.camera, placed)
    return group.measured.residuals(sensor.camera, placed, sensor.depth_offset, sensor.depth_scale)

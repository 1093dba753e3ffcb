"""Free parameters of a state: names, columns, and application of increments.

Every parameter is an increment on the initial state. Poses rotate about the axes of the rig: R ← exp(δ) R, t ← t + δt,
so that no rotation is near a singularity and deviations are angles about those axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle.parameters.lens_parameters import MATRIX, PRIOR_SIGMA, LensKind
from calib.solve.bundle.parameters.state import SensorState, State

POSE = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
DEPTH_TERMS = ("depth_offset", "depth_scale")

#: Deviations of depth terms from zero [m, 1]: far more than a working depth camera's, so that they only hold what the
#: shots do not.
DEPTH_PRIORS: Mapping[str, float] = {"depth_offset": 0.05, "depth_scale": 0.05}


@dataclass(frozen=True)
class FreeParameters:
    """Free parameters of one sensor.

    Attributes:
        kind: kind of its lens.
        intrinsics: names of the free intrinsics: camera matrix and lens coefficients, or none.
        fixed_aspect: True if fy / fx is fixed: fy, which is not among the intrinsics, follows fx.
        moves: True if its pose is free; false for the reference sensor.
        depth: free ones of `DEPTH_TERMS`.
        free_running: True if its clock has an unknown offset (free-running sensor).
    """

    kind: LensKind
    intrinsics: tuple[str, ...] = ()
    moves: bool = True
    depth: tuple[str, ...] = ()
    free_running: bool = False
    fixed_aspect: bool = False

    def of_intrinsics(self, derivatives: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
        """Derivatives (…, k) by the free intrinsics from those (…, 4 + n) by camera matrix and coefficients."""
        order = [*MATRIX, *self.kind.coefficients]
        chosen = derivatives[..., [order.index(each) for each in self.intrinsics]]
        if self.fixed_aspect:
            chosen[..., self.intrinsics.index("fx")] += camera.fy / camera.fx * derivatives[..., order.index("fy")]
        return chosen

    @property
    def priors(self) -> Mapping[str, float]:
        """Standard deviations of the free parameters that have a prior around zero."""
        lens = {name: PRIOR_SIGMA for name in self.kind.regularized if name in self.intrinsics}
        return lens | {name: DEPTH_PRIORS[name] for name in self.depth}

    @property
    def names(self) -> tuple[str, ...]:
        """All free parameters of the sensor, in the order of the vector."""
        return (
            self.intrinsics
            + (POSE if self.moves else ())
            + self.depth
            + (("time_offset",) if self.free_running else ())
        )


@dataclass(frozen=True)
class Layout:
    """Parameter vector: the free parameters of each sensor, then six for the board pose of every shot."""

    free_parameters: Mapping[str, FreeParameters]
    shots: Sequence[int]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of every parameter, such as `tof.fx`, `color.rotation_x` or `board 3.z`."""
        sensors = [f"{sensor}.{name}" for sensor, free in self.free_parameters.items() for name in free.names]
        return (*sensors, *(f"board {shot}.{name}" for shot in self.shots for name in POSE))

    @cached_property
    def starts(self) -> Mapping[str, int]:
        """First column of every sensor."""
        counts = [len(free.names) for free in self.free_parameters.values()]
        return dict(zip(self.free_parameters, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))

    @property
    def board_start(self) -> int:
        """First column of the board poses."""
        return sum(len(free.names) for free in self.free_parameters.values())

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.board_start + 6 * len(self.shots)

    def columns(self, sensor: str, names: Sequence[str]) -> NDArray[np.intp]:
        """Columns of some free parameters of a sensor."""
        own = self.free_parameters[sensor].names
        return np.array([self.starts[sensor] + own.index(name) for name in names], np.intp)

    def move(self, state: State, increments: NDArray[np.float64]) -> State:
        """State after increments (size,)."""
        boards = increments[self.board_start :].reshape(-1, 6)
        return State(
            self.sensors(state, increments),
            {shot: turned(state.boards[shot], step) for shot, step in zip(self.shots, boards, strict=True)},
        )

    def sensors(self, state: State, increments: NDArray[np.float64]) -> dict[str, SensorState]:
        """Sensors of a state after increments (size,)."""
        return {name: self._moved(name, sensor, increments) for name, sensor in state.sensors.items()}

    def _moved(self, name: str, sensor: SensorState, increments: NDArray[np.float64]) -> SensorState:
        free = self.free_parameters[name]
        start = self.starts[name]
        steps = dict(zip(free.names, increments[start : start + len(free.names)].tolist(), strict=True))
        if free.fixed_aspect:
            steps["fy"] = steps["fx"] * sensor.camera.fy / sensor.camera.fx
        camera = _refitted(sensor.camera, free.kind, steps)
        if free.moves:
            camera = replace(camera, T_rs=turned(camera.T_rs, np.array([steps[name] for name in POSE])))
        return SensorState(
            camera,
            sensor.depth_offset + steps.get("depth_offset", 0.0),
            sensor.depth_scale + steps.get("depth_scale", 0.0),
            sensor.time_offset + steps.get("time_offset", 0.0),
        )


def turned(T_ab: Pose, increments: NDArray[np.float64]) -> Pose:
    """Pose after increments (6,): rotation about the axes of a by the first three, translation by the others."""
    turn = pose.from_rotation_vector(increments[:3], np.zeros(3))
    moved = T_ab.copy()
    moved[:3, :3] = turn[:3, :3] @ T_ab[:3, :3]
    moved[:3, 3] += increments[3:]
    return moved


def _refitted(camera: Camera, kind: LensKind, steps: Mapping[str, float]) -> Camera:
    matrix = {name: float(getattr(camera, name)) + steps.get(name, 0.0) for name in MATRIX}
    bends = np.array([steps.get(name, 0.0) for name in kind.every])
    if not np.any(bends):
        return replace(camera, **matrix)
    return replace(camera, **matrix, lens=kind.make(camera.lens.coefficients + bends))

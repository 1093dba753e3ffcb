"""Result of a calibration: parameters with deviations, and residuals of every view."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from calib.solve.bundle import robust
from calib.solve.bundle.adjustment import Adjustment
from calib.solve.bundle.blocks import Corners
from calib.solve.bundle.formulation import groups_of
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, POSE, FreeParameters
from calib.solve.bundle.parameters.lens_parameters import MATRIX
from calib.solve.bundle.parameters.state import SensorState, State
from calib.solve.bundle.tasks import Task


@dataclass(frozen=True)
class Parameter:
    """One estimated parameter.

    Attributes:
        name: such as `tof.fx` or `board 3.z`.
        value: [px], 1, [m], [s]; for rotations a component of the rotation vector [rad].
        sigma: its standard deviation in the same unit; for rotations that of a small rotation about an axis of the rig.
    """

    name: str
    value: float
    sigma: float


@dataclass(frozen=True)
class ViewFit:
    """Residuals of one view.

    Attributes:
        sensor, shot: identify the view.
        of: "corners" or "distances".
        pixels: positions (n, 2) [px].
        residuals: predicted minus measured, (n, 2) [px] for corners, (n,) [m] for distances.
        outliers: mask (n,).
    """

    sensor: str
    shot: int
    of: str
    pixels: NDArray[np.float64]
    residuals: NDArray[np.float64]
    outliers: NDArray[np.bool_]

    @property
    def rms(self) -> float:
        """Root mean square reprojection error [px] or distance error [m]."""
        return float(np.sqrt(np.mean(np.sum(self.residuals.reshape(len(self.pixels), -1) ** 2, axis=1))))


@dataclass(frozen=True)
class Solution:
    """Solved calibration.

    Attributes:
        task: the task without unusable views.
        adjustment: minimum and covariance.
    """

    task: Task
    adjustment: Adjustment

    @property
    def state(self) -> State:
        """Estimated state."""
        return self.adjustment.state

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Cameras by sensor, with their poses in the rig."""
        return {name: sensor.camera for name, sensor in self.state.sensors.items()}

    @property
    def boards(self) -> Mapping[int, Pose]:
        """Board poses `T_rb` by shot."""
        return self.state.boards

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of all parameters, in the order of `parameters` (n, n)."""
        return self.adjustment.covariance

    @property
    def values(self) -> list[float]:
        """Values of all free parameters, in the order of the covariance."""
        layout = self.adjustment.layout
        values = [
            _value(self.state.sensors[sensor], free, name)
            for sensor, free in layout.free_parameters.items()
            for name in free.names
        ]
        for shot in layout.shots:
            values.extend(np.concatenate(pose.to_rotation_vector(self.state.boards[shot])).tolist())
        return values

    @cached_property
    def parameters(self) -> list[Parameter]:
        """All free parameters, in the order of the covariance."""
        sigmas = np.sqrt(np.diag(self.covariance)).tolist()
        return [Parameter(*each) for each in zip(self.adjustment.layout.names, self.values, sigmas, strict=True)]

    @cached_property
    def views(self) -> list[ViewFit]:
        """Residuals of every view by sensor, corners before distances."""
        found = []
        equations = self.adjustment.equations
        named = groups_of(self.task)
        for group, rows, (sensor, views) in zip(equations.groups, equations.slices(), named, strict=True):
            corners = isinstance(group.measured, Corners)
            white = self.adjustment.residuals[rows].reshape(len(group.measured.pixels), -1)
            own = white * group.measured.sigmas[:, None]
            for number, view in enumerate(views):
                mine = group.measured.views == number
                far = np.linalg.norm(white[mine], axis=1) > robust.OUTLIER
                residuals = own[mine] if corners else own[mine, 0]
                of = "corners" if corners else "distances"
                found.append(ViewFit(sensor, view.shot, of, group.measured.pixels[mine], residuals, far))
        return found

    @cached_property
    def deviations(self) -> Mapping[str, float]:
        """Estimated standard deviation of a corner coordinate [px] or a distance [m], by group: `tof corners`."""
        groups = self.adjustment.equations.groups
        return {group.name: float(np.median(group.measured.sigmas)) for group in groups}


def _value(sensor: SensorState, free: FreeParameters, name: str) -> float:
    camera = sensor.camera
    if name in MATRIX:
        return float(getattr(camera, name))
    if name in POSE:
        return float(np.concatenate(pose.to_rotation_vector(camera.T_rs))[POSE.index(name)])
    if name in (*DEPTH_TERMS, "time_offset"):
        return float(getattr(sensor, name))
    return float(camera.lens.coefficients[free.kind.coefficients.index(name)])

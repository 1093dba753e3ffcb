"""What a calibration found, with deviations of everything and residuals of every view."""

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
from calib.solve.bundle.layout import DEPTH_TERMS, POSE, Freedom
from calib.solve.bundle.lens_parameters import MATRIX
from calib.solve.bundle.state import SensorState, State
from calib.solve.bundle.tasks import Task


@dataclass(frozen=True)
class Parameter:
    """One number that was determined.

    Attributes:
        name: such as `tof.fx` or `board 3.z`.
        value: [px], 1, [m], [s]; of rotations a part of the rotation vector [rad].
        sigma: its deviation in the same unit; of rotations that of a small turn about an axis of the rig.
    """

    name: str
    value: float
    sigma: float


@dataclass(frozen=True)
class ViewFit:
    """How well one view is explained.

    Attributes:
        sensor, shot: which.
        of: "corners" or "distances".
        pixels: where (n, 2) [px].
        residuals: predicted less measured, (n, 2) [px] of corners, (n,) [m] of distances.
        outliers: which of them count as such (n,).
    """

    sensor: str
    shot: int
    of: str
    pixels: NDArray[np.float64]
    residuals: NDArray[np.float64]
    outliers: NDArray[np.bool_]

    @property
    def rms(self) -> float:
        """Root mean square of a corner's miss [px] or of a distance's [m]."""
        return float(np.sqrt(np.mean(np.sum(self.residuals.reshape(len(self.pixels), -1) ** 2, axis=1))))


@dataclass(frozen=True)
class Solution:
    """A solved calibration.

    Attributes:
        task: what was asked, without views that could not be used.
        adjustment: the minimum itself.
    """

    task: Task
    adjustment: Adjustment

    @property
    def state(self) -> State:
        """Everything that was determined."""
        return self.adjustment.state

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """By sensor, with their poses in the rig."""
        return {name: sensor.camera for name, sensor in self.state.sensors.items()}

    @property
    def boards(self) -> Mapping[int, Pose]:
        """`T_rb` by shot."""
        return self.state.boards

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of all parameters, in the order of `parameters` (n, n)."""
        return self.adjustment.covariance

    @cached_property
    def parameters(self) -> list[Parameter]:
        """Everything that was free, in the order of the covariance."""
        layout = self.adjustment.layout
        values = [
            _value(self.state.sensors[sensor], freedom, name)
            for sensor, freedom in layout.freedoms.items()
            for name in freedom.names
        ]
        for shot in layout.shots:
            values.extend(np.concatenate(pose.to_rotation_vector(self.state.boards[shot])).tolist())
        sigmas = np.sqrt(np.diag(self.covariance)).tolist()
        return [Parameter(*each) for each in zip(layout.names, values, sigmas, strict=True)]

    @cached_property
    def views(self) -> list[ViewFit]:
        """Every view, corners before distances, sensor by sensor."""
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
        """What one corner's coordinate [px] or one distance [m] turned out to scatter, by group: `tof corners`."""
        groups = self.adjustment.equations.groups
        return {group.name: float(np.median(group.measured.sigmas)) for group in groups}


def _value(sensor: SensorState, freedom: Freedom, name: str) -> float:
    camera = sensor.camera
    if name in MATRIX:
        return float(getattr(camera, name))
    if name in POSE:
        return float(np.concatenate(pose.to_rotation_vector(camera.T_rs))[POSE.index(name)])
    if name in (*DEPTH_TERMS, "time_offset"):
        return float(getattr(sensor, name))
    return float(camera.lens.coefficients[freedom.kind.coefficients.index(name)])

"""Input of a calibration check: a stored calibration, and new views of a board."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.board.views import CornerView, PlaneView
from calib.solve.bundle.parameters.layout import POSE, FreeParameters
from calib.solve.bundle.parameters.lens_parameters import MATRIX
from calib.solve.bundle.parameters.state import SensorState
from calib.solve.start.board_poses import pose_candidates


class CalibrationCheckError(ValueError):
    """Views that do not allow a check of the calibration."""


@dataclass(frozen=True)
class Stored:
    """Stored calibration.

    Attributes:
        sensors: cameras and depth terms.
        names: of parameters with known covariance, such as `color.rotation_x`.
        covariance: of these parameters (n, n).
    """

    sensors: Mapping[str, SensorState]
    names: tuple[str, ...] = ()
    covariance: NDArray[np.float64] | None = None

    def of_pose(self, sensor: str) -> list[int]:
        """Rows of the covariance of a sensor's pose; empty if it is unknown."""
        wanted = [f"{sensor}.{name}" for name in POSE]
        return [self.names.index(name) for name in wanted] if set(wanted) <= set(self.names) else []

    def uncertain(self, sensor: str, free: FreeParameters) -> FreeParameters:
        """Free parameters of a sensor, and its intrinsics with stored deviations."""
        intrinsics = tuple(name for name in (*MATRIX, *free.kind.coefficients) if f"{sensor}.{name}" in self.names)
        # Deviations do not say whether fy was fixed or followed fx; the latter is what `--fix aspect` is for.
        follows = "fx" in intrinsics and "fy" not in intrinsics
        return replace(free, intrinsics=intrinsics, fixed_aspect=follows)


@dataclass(frozen=True)
class Views:
    """New views of a board."""

    corners: Sequence[CornerView]
    planes: Sequence[PlaneView]

    def of(self, sensors: Collection[str], shots: Collection[int]) -> "Views":
        """Views of some sensors and shots."""
        return Views(
            [view for view in self.corners if view.sensor in sensors and view.shot in shots],
            [view for view in self.planes if view.sensor in sensors and view.shot in shots],
        )

    @property
    def shots(self) -> dict[str, set[int]]:
        """Numbers of the shots of each sensor."""
        found: dict[str, set[int]] = {}
        for view in (*self.corners, *self.planes):
            found.setdefault(view.sensor, set()).add(view.shot)
        return found


def usable(stored: Stored, views: Views) -> Views:
    """Views with a valid board pose in front of the stored cameras.

    Raises:
        CalibrationCheckError: none is left.
    """
    corners = [view for view in views.corners if pose_candidates(stored.sensors[view.sensor].camera, view)]
    if not corners:
        raise CalibrationCheckError("no view shows a board that a sensor of this calibration could have seen")
    shots = {view.shot for view in corners}
    return Views(corners, [view for view in views.planes if view.shot in shots])

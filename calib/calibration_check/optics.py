"""Change of a sensor's optics since the calibration, by its own corners.

Boards with free poses hide most of another focal length or principal point from the residuals. Each distinct pose pulls
them with its own score (see `calib.solve.bundle.uncertainty`): one step along them is the change, and how far the poses
disagree is its deviation. Errors of the stored intrinsics count by the step that they cause in these views.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calib.calibration_check.board_poses import formulation, solve
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle import robust
from calib.solve.bundle.parameters.lens_parameters import MATRIX
from calib.solve.bundle.uncertainty import (
    MIN_POSES,
    PoseInformation,
    noise_covariance,
    pose_covariance,
    pose_information,
)
from calib.solve.rounding import rounded

#: Threshold of significance: exceeded by chance in one check of a thousand.
QUANTILE = float(stats.chi2.ppf(0.999, 3))

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OpticsChange:
    """Change of a sensor's focal length and principal point since the calibration.

    Attributes:
        values, sigmas: relative change of the focal length, and that of cx and cy [px] (3,).
        shift_px: resulting shift of the corners [px], root mean square.
        squared: squared Mahalanobis distance; chi-squared with 3 degrees of freedom without a change.
        unseen: largest relative change of the focal length alone that these views would not show.
    """

    values: Array
    sigmas: Array
    shift_px: float
    squared: float
    unseen: float

    @property
    def is_significant(self) -> bool:
        """True if the change is significant."""
        return self.squared > QUANTILE

    def __str__(self) -> str:
        """One clause for people."""
        (focal, across, down), sigma = self.values.tolist(), float(self.sigmas[0])
        return (
            f"its focal length is {focal:+.2%} ± {sigma:.2%} and its principal point ({across:+.1f}, {down:+.1f}) px "
            f"from what was calibrated, which shifts its pictures by {rounded(self.shift_px)} px"
        )


def optics_change(stored: Stored, views: Views, sensor: str) -> OpticsChange | None:
    """Change of a sensor that detects corners; None with too few distinct poses, or if no deviations are stored."""
    own = Views([view for view in views.corners if view.sensor == sensor], ())
    needed = {f"{sensor}.{name}" for name in MATRIX if name != "fy"}
    if stored.covariance is None or not needed <= {*stored.names}:
        return None
    adjusted = solve(stored, own, ()).adjustment
    if len(np.unique(adjusted.equations.poses)) < MIN_POSES:
        return None
    equations = formulation(stored, own, (), uncertain=True)(adjusted.state, adjusted.factors)
    poses = pose_information(equations, adjusted.residuals)
    camera = stored.sensors[sensor].camera
    names = [name.partition(".")[2] for name in equations.layout.names[: equations.layout.board_start]]
    directions = np.zeros((len(names), 3))
    for name, column, size in (("fx", 0, camera.fx), ("fy", 0, camera.fy), ("cx", 1, 1.0), ("cy", 2, 1.0)):
        if name in names:
            directions[names.index(name), column] = size
    whole = poses.information.sum(axis=0)
    taken = np.linalg.solve(directions.T @ whole @ directions, directions.T)
    step = -taken @ poses.scores.sum(axis=0) / poses.efficiency
    by_stored = taken @ whole
    rows = [stored.names.index(f"{sensor}.{name}") for name in names]
    covariance = _noise(poses, directions, step, adjusted.residuals)
    covariance += by_stored @ stored.covariance[np.ix_(rows, rows)] @ by_stored.T
    pixels = np.concatenate([view.pixels for view in own.corners]) - (camera.cx, camera.cy)
    shift = float(np.sqrt(np.mean(np.sum((step[0] * pixels + step[1:]) ** 2, axis=1))))
    precision = np.linalg.inv(covariance)
    unseen = float(np.sqrt(QUANTILE / precision[0, 0]))
    return OpticsChange(step, np.sqrt(np.diag(covariance)), shift, float(step @ precision @ step), unseen)


def _noise(poses: PoseInformation, directions: Array, step: Array, residuals: Array) -> Array:
    """Covariance of a step (3, 3) along directions (k, 3), by how far the poses disagree about it."""
    information = directions.T @ poses.information @ directions
    left = poses.scores @ directions + poses.efficiency * information @ step
    along = PoseInformation(information, left, poses.repeats, np.zeros((3, 3)), poses.efficiency)
    return pose_covariance(along, noise_covariance(along, robust.covariance_inflation(residuals)))

"""Fit of each stored sensor to its own corners, and of its distances to them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration_check.board_poses import solve
from calib.calibration_check.changes import MIN_SHOTS
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle import robust
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.start.board_poses import pose_candidates
from calib.solve.validation.inconsistent_shots.foreign_distances import DistanceError, wrong_distances


@dataclass(frozen=True)
class CornerFit:
    """Residuals of a stored camera on its own corners, with free board poses.

    Attributes:
        pixels, residuals: of the corners (n, 2) [px]; predicted minus measured.
        views: number of views.
    """

    pixels: NDArray[np.float64]
    residuals: NDArray[np.float64]
    views: int

    @property
    def rms(self) -> float:
        """Root mean square reprojection error [px] without gross errors."""
        squares = np.sum(self.residuals**2, axis=1)
        return float(np.sqrt(np.mean(squares[squares <= robust.OUTLIER**2 * np.median(squares)])))


def corner_fit(stored: Stored, views: Views, sensor: str) -> CornerFit:
    """Residuals of one sensor that detects corners."""
    own = Views([view for view in views.corners if view.sensor == sensor], ())
    adjusted = solve(stored, own, ()).adjustment
    group = adjusted.equations.groups[0]
    residuals = (adjusted.residuals.reshape(-1, 2)) * group.measured.sigmas[:, None]
    return CornerFit(group.measured.pixels, residuals, len(own.corners))


@dataclass(frozen=True)
class DistanceBias:
    """Mean difference between a sensor's measured distances and those derived from its corners.

    Attributes:
        mean: over the views [m].
        sigma: standard error of the mean, from the scatter of the views [m].
    """

    mean: float
    sigma: float


def distance_bias(stored: Stored, views: Views, sensor: str) -> DistanceBias | None:
    """Bias of a sensor with corners and distances in the same shots; None with fewer than three."""
    corners = [view for view in views.corners if view.sensor == sensor]
    boards = {view.shot: pose_candidates(stored.sensors[sensor].camera, view) for view in corners}
    state = stored.sensors[sensor]
    excesses: list[float] = []
    for view in views.planes:
        if view.sensor == sensor and boards.get(view.shot):
            T_sb = boards[view.shot][0].T_sb
            excesses.append(float(np.median(view.distances - state.predicted_distances(T_sb, view.pixels))))
    if len(excesses) < MIN_SHOTS:
        return None
    return DistanceBias(float(np.mean(excesses)), float(np.std(excesses, ddof=1) / np.sqrt(len(excesses))))


def distance_error(stored: Stored, views: Views, sensor: str, needed_px: float) -> DistanceError | None:
    """Mistake in the distances of a sensor, by its own corners, or by those of all others if it makes no image.

    None without any, and if the other sensors contradict each other.

    Args:
        stored, views, sensor: as above.
        needed_px: displacement of its depth image beyond which that is a mistake [px].
    """
    planes = [view for view in views.planes if view.sensor == sensor]
    shots = {view.shot for view in planes}
    own = [view for view in views.corners if view.sensor == sensor and view.shot in shots]
    corners = own or [view for view in views.corners if view.shot in shots]
    seen = {view.shot for view in corners}
    used = Views(corners, [view for view in planes if view.shot in seen])
    if not used.planes:
        return None
    try:
        return next(iter(wrong_distances(solve(stored, used, ()), needed_px)), None)
    except NotSolvedError:
        return None

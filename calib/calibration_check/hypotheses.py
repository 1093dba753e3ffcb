"""Fit of each stored camera to its own corners, and hypotheses about a sensor that moved."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calib.calibration_check.board_poses import cost, loss, solve
from calib.calibration_check.changes import MIN_SHOTS
from calib.calibration_check.stored import Stored, Views
from calib.solve.bundle import robust
from calib.solve.start.board_poses import pose_candidates

#: A sensor is a suspect if its motion explains this share of the excess cost …
EXPLAINS = 0.9

#: … and the remaining cost is at most this many times that of the best hypothesis.
RIVAL = 4.0


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
    adjusted = solve(stored, own, ())
    group = adjusted.equations.groups[0]
    residuals = (adjusted.residuals.reshape(-1, 2)) * group.measured.sigmas[:, None]
    return CornerFit(group.measured.pixels, residuals, len(own.corners))


@dataclass(frozen=True)
class DistanceBias:
    """Mean difference between a sensor's measured distances and those derived from its corners.

    Attributes:
        mean: over the views [m].
        sigma: standard error of the mean, from the scatter of the views [m].
        views: number of views.
    """

    mean: float
    sigma: float
    views: int


def distance_bias(stored: Stored, views: Views, sensor: str) -> DistanceBias | None:
    """Bias of a sensor with corners and distances in the same shots; None with fewer than three."""
    corners = [view for view in views.corners if view.sensor == sensor]
    boards = {view.shot: pose_candidates(stored.sensors[sensor].camera, view) for view in corners}
    state = stored.sensors[sensor]
    excesses: list[float] = []
    for view in views.planes:
        if view.sensor == sensor and boards.get(view.shot):
            T_sb = boards[view.shot][0].T_sb
            directions = replace(state.camera, T_rs=np.eye(4)).directions(view.pixels)
            true = (T_sb[:3, 2] @ T_sb[:3, 3]) / (directions @ T_sb[:3, 2])
            predicted = (1 + state.depth_scale) * true + state.depth_offset
            excesses.append(float(np.median(view.distances - predicted)))
    if len(excesses) < MIN_SHOTS:
        return None
    return DistanceBias(
        float(np.mean(excesses)), float(np.std(excesses, ddof=1) / np.sqrt(len(excesses))), len(excesses)
    )


@dataclass(frozen=True)
class MotionHypothesis:
    """Result of the hypothesis that one sensor moved.

    Attributes:
        share: motion_hypotheses share of the excess cost, 0…1.
        left: remaining cost, in squared deviations; chi-squared with 6 degrees of freedom for each sensor but two, if
            this sensor is the only one that moved and the others are exactly as stored.
    """

    share: float
    left: float


def motion_hypotheses(stored: Stored, views: Views) -> dict[str, MotionHypothesis]:
    """Result of each hypothesis, by sensor.

    All hypotheses are compared with the same deviations: those estimated with all poses free.
    """
    names = list(views.shots)
    everything = solve(stored, views, names[1:])
    least = float(np.sum(loss(everything.residuals)))
    gap = max(cost(stored, views, (), everything.factors) - least, 1e-12)
    left = {name: max(cost(stored, views, (name,), everything.factors) - least, 0.0) for name in names}
    return {name: MotionHypothesis(float(np.clip(1 - one / gap, 0, 1)), one) for name, one in left.items()}


def moved_candidates(explanations: Mapping[str, MotionHypothesis]) -> list[str]:
    """Sensors that may be the one that moved; none if no single motion explains the residuals."""
    if not explanations:
        return []
    chance = float(stats.chi2.ppf(0.999, 6 * max(len(explanations) - 2, 1)))
    best = min(one.left for one in explanations.values())
    return [name for name, one in explanations.items() if one.share >= EXPLAINS and one.left <= RIVAL * best + chance]

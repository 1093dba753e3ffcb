"""Does each camera explain its own corners, and which sensor, set free, explains the rest?"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calib.calibration_check.board_poses import cost, loss, solve
from calib.calibration_check.changes import LEAST_SHOTS
from calib.calibration_check.stored import Stored, Views
from calib.solve.bundle import robust
from calib.solve.start.board_poses import sightings

#: A sensor that explains this share of what does not fit may have moved …
EXPLAINS = 0.9

#: … unless another leaves so many times less.
RIVAL = 4.0


@dataclass(frozen=True)
class OwnFit:
    """How well a stored camera explains its own corners, each board placed for itself.

    Attributes:
        pixels, residuals: of the corners (n, 2) [px]; predicted less measured.
        views: number of views.
    """

    pixels: NDArray[np.float64]
    residuals: NDArray[np.float64]
    views: int

    @property
    def rms(self) -> float:
        """Root mean square of a corner's miss [px], gross errors left out."""
        squares = np.sum(self.residuals**2, axis=1)
        return float(np.sqrt(np.mean(squares[squares <= robust.OUTLIER**2 * np.median(squares)])))


def own_fit(stored: Stored, views: Views, sensor: str) -> OwnFit:
    """Of one sensor that sees corners."""
    own = Views([view for view in views.corners if view.sensor == sensor], ())
    adjusted = solve(stored, own, ())
    group = adjusted.equations.groups[0]
    residuals = (adjusted.residuals.reshape(-1, 2)) * group.measured.sigmas[:, None]
    return OwnFit(group.measured.pixels, residuals, len(own.corners))


@dataclass(frozen=True)
class DistanceBias:
    """By how much a sensor's distances to boards exceed those that its own corners say.

    Attributes:
        mean: over the views [m].
        sigma: deviation of the mean, as the views scatter [m].
        views: number of views.
    """

    mean: float
    sigma: float
    views: int


def distance_bias(stored: Stored, views: Views, sensor: str) -> DistanceBias | None:
    """Of a sensor that sees corners and measures distances in the same shots; None if there are fewer than three."""
    corners = [view for view in views.corners if view.sensor == sensor]
    boards = {view.shot: sightings(stored.sensors[sensor].camera, view) for view in corners}
    state = stored.sensors[sensor]
    excesses: list[float] = []
    for view in views.planes:
        if view.sensor == sensor and boards.get(view.shot):
            T_sb = boards[view.shot][0].T_sb
            directions = replace(state.camera, T_rs=np.eye(4)).directions(view.pixels)
            true = (T_sb[:3, 2] @ T_sb[:3, 3]) / (directions @ T_sb[:3, 2])
            predicted = (1 + state.depth_scale) * true + state.depth_offset
            excesses.append(float(np.median(view.distances - predicted)))
    if len(excesses) < LEAST_SHOTS:
        return None
    return DistanceBias(
        float(np.mean(excesses)), float(np.std(excesses, ddof=1) / np.sqrt(len(excesses))), len(excesses)
    )


@dataclass(frozen=True)
class Explanation:
    """What setting one sensor free makes of what does not fit.

    Attributes:
        share: that goes away, 0…1.
        left: that stays, in squared deviations; chi-squared with 6 degrees of freedom for each sensor but two, if this
            sensor is the only one that moved and the others stand exactly as they were stored.
    """

    share: float
    left: float


def explained(stored: Stored, views: Views) -> dict[str, Explanation]:
    """What each sensor would explain, by sensor.

    All hypotheses are compared with the same deviations: those with which everything is free.
    """
    names = list(views.shots)
    everything = solve(stored, views, names[1:])
    least = float(np.sum(loss(everything.residuals)))
    gap = max(cost(stored, views, (), everything.factors) - least, 1e-12)
    left = {name: max(cost(stored, views, (name,), everything.factors) - least, 0.0) for name in names}
    return {name: Explanation(float(np.clip(1 - one / gap, 0, 1)), one) for name, one in left.items()}


def suspects(explanations: Mapping[str, Explanation]) -> list[str]:
    """The sensors any of which may be the one that moved; none if no single one explains it."""
    if not explanations:
        return []
    chance = float(stats.chi2.ppf(0.999, 6 * max(len(explanations) - 2, 1)))
    best = min(one.left for one in explanations.values())
    return [name for name, one in explanations.items() if one.share >= EXPLAINS and one.left <= RIVAL * best + chance]

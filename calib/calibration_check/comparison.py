"""Comparison of hypotheses about a rig by how well each predicts the shots that it was not fitted to.

Every shot is predicted from all others: log p(shot | others), with the uncertainty of what was fitted, so that more
parameters win only if they predict better. Differences of two hypotheses are judged by their scatter over the shots,
which errors that a shot's pixels share do not narrow. What scatters from shot to shot is estimated first, with all
changes allowed. Source: leave-one-out predictive densities, Vehtari, Gelman, Gabry, Statistics and Computing 2017.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from calib.calibration_check.hypotheses import Hypothesis, Kind, board, hypotheses
from calib.calibration_check.shot_equations import Linearised, WhiteShot, linearise
from calib.calibration_check.stored_calibration import Stored, Views

#: A hypothesis predicts better if the shots are e³ times as probable, and by this many standard errors …
DECISIVE, STANDARD_ERRORS = 3.0, 2.0

#: … where no shot counts for more than a factor of e¹⁰.
MAX_NATS = 10.0

#: Candidate scatter of the board's place from view to view [m].
SCATTERS = (0.0, *np.geomspace(3e-5, 0.1, 15).tolist())

#: Number of times that the board's size is found again, each time about the last one.
BOARD_ROUNDS = 2

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Explanation:
    """A hypothesis with its evidence from the shots.

    Attributes:
        hypothesis: the hypothesis.
        values: of its changes, in the order of its columns (k,) [rad, m, 1].
        sigmas: their standard deviations (k,).
        scores: logarithm of the predictive density of every shot (shots,) [nats].
        stored: likewise of the stored calibration, whose deviations leave room for some change [nats].
    """

    hypothesis: Hypothesis
    values: Array
    sigmas: Array
    scores: Array
    stored: float

    @property
    def board_size(self) -> float:
        """Factor by which the board is larger than described, of a hypothesis about that."""
        return float(1 / (1 - min(self.values[0], 0.9)))

    def beats(self, other: "Explanation") -> bool:
        """True if it predicts the shots better than another one, beyond doubt."""
        gains = np.clip(self.scores - other.scores, -MAX_NATS, MAX_NATS)
        doubt = float(np.std(gains, ddof=1)) * np.sqrt(len(gains))
        return float(np.sum(gains)) + self.stored - other.stored > max(DECISIVE, STANDARD_ERRORS * doubt)


@dataclass(frozen=True)
class Comparison:
    """Explanations of the shots.

    Attributes:
        explanations: all of them, the best prediction first.
        corners_m, distances_m: scatter from shot to shot of where corners and distances see the board [m].
        distance_m: median distance of the boards [m].
    """

    explanations: Sequence[Explanation]
    corners_m: float
    distances_m: float
    distance_m: float

    @property
    def chosen(self) -> Explanation:
        """Explanation with the fewest parameters of those that no other beats; a sensor's before the board's."""
        return min(self._unbeaten, key=lambda each: (len(each.values), each.hypothesis.kind == Kind.BOARD))

    @property
    def rivals(self) -> list[Explanation]:
        """Explanations that these shots cannot distinguish from the chosen one, without those that contain it."""
        chosen = self.chosen
        return [
            each for each in self._unbeaten if each is not chosen and not each.hypothesis.contains(chosen.hypothesis)
        ]

    def without_focal(self, unseen: Mapping[str, float]) -> "Comparison":
        """Comparison without the other focal lengths that a sensor's own corners would have shown.

        Args:
            unseen: largest relative change that they would not show, by sensor.
        """
        kept = [
            each
            for each in self.explanations
            if each.hypothesis.kind != Kind.FOCAL
            or abs(each.values[0]) <= unseen.get(each.hypothesis.sensors[0], np.inf)
        ]
        return replace(self, explanations=kept)

    @property
    def _unbeaten(self) -> list[Explanation]:
        return [each for each in self.explanations if not self.explanations[0].beats(each)]


#: What stands in for a comparison of fewer than two sensors.
NOT_COMPARED = Comparison(
    (Explanation(Hypothesis(Kind.UNCHANGED), np.zeros(0), np.zeros(0), np.zeros(2), 0.0),), 0.0, 0.0, 1.0
)


def compare(stored: Stored, views: Views) -> Comparison:
    """Explanations of new views of two sensors or more.

    Raises:
        UndeterminedError, NotSolvedError: the views do not determine the poses of sensors or boards.
    """
    seen = linearise(stored, views)
    vague = _stored_changes(stored, seen.names)
    corners_m, distances_m = _scatter(seen, stored, vague)
    white = [shot.whitened(corners_m, distances_m) for shot in seen.shots]
    found = [_explanation(each, seen.names, vague, white) for each in hypotheses(stored, seen.names)]
    of_board = _explanation(board(stored, seen.names), seen.names, vague, white)
    for _ in range(BOARD_ROUNDS):
        of_board = _explanation(board(stored, seen.names, of_board.board_size), seen.names, vague, white)
    found.append(of_board)
    return Comparison(
        sorted(found, key=lambda each: -each.scores.sum() - each.stored), corners_m, distances_m, seen.distance_m
    )


def _stored_changes(stored: Stored, names: Sequence[str]) -> Array:
    """Changes (n, k) by one deviation each of the stored calibration's undetermined directions.

    Intrinsics are among them: a principal point and a turn that were stored wrong together move no picture.
    """
    known = [name for name in stored.names if name in names]
    if stored.covariance is None or not known:
        return np.zeros((len(names), 0))
    rows = [stored.names.index(name) for name in known]
    covariance = stored.covariance[np.ix_(rows, rows)]
    # Pixels and radians differ by more digits than the decomposition has.
    sigmas = np.sqrt(np.diag(covariance))
    variances, directions = linalg.eigh(covariance / np.outer(sigmas, sigmas))
    changes = np.zeros((len(names), len(known)))
    changes[[names.index(name) for name in known]] = sigmas[:, None] * directions * np.sqrt(np.maximum(variances, 0))
    return changes


def _scatter(seen: Linearised, stored: Stored, vague: Array) -> tuple[float, float]:
    """Scatter of corners and distances that predicts the shots best, whatever changed [m]."""
    every = np.hstack([hypotheses(stored, seen.names)[-1].basis(seen.names), vague])
    best = (0.0, 0.0)
    for _ in range(2):
        for index in range(2):
            tried = [(value, best[1]) if index == 0 else (best[0], value) for value in SCATTERS]
            best = max(tried, key=lambda each: _fit(every, [shot.whitened(*each) for shot in seen.shots])[2].sum())
    return best


def _explanation(hypothesis: Hypothesis, names: Sequence[str], vague: Array, white: Sequence[WhiteShot]) -> Explanation:
    basis = hypothesis.basis(names)
    steps, covariance, scores = _fit(np.hstack([basis, vague]), white)
    units = hypothesis.units(names)
    count = len(units)
    sigmas = np.sqrt(np.diag(covariance)[:count]) * units
    stored = -0.5 * float(steps[count:] @ steps[count:])
    return Explanation(hypothesis, steps[:count] * units, sigmas, scores, stored)


def _fit(basis: Array, white: Sequence[WhiteShot]) -> tuple[Array, Array, Array]:
    """Steps along a basis (n, k), their covariance, and the score of every shot predicted from the others (shots,).

    Steps have a normal prior of unit deviation.
    """
    jacobians = [shot.jacobian @ basis for shot in white]
    parts = [(own.T @ own, own.T @ shot.residuals) for own, shot in zip(jacobians, white, strict=True)]
    curvature = np.eye(basis.shape[1]) + sum(part[0] for part in parts)
    slope = sum(part[1] for part in parts)
    scores = []
    for shot, own, (curved, sloped) in zip(white, jacobians, parts, strict=True):
        factor = linalg.cho_factor(curvature - curved)
        left = shot.residuals - own @ linalg.cho_solve(factor, slope - sloped)
        spread = np.eye(len(left)) + own @ linalg.cho_solve(factor, own.T)
        whitening = linalg.cholesky(spread, lower=True)
        chances = linalg.solve_triangular(whitening, left, lower=True)
        scores.append(-0.5 * float(chances @ chances) - float(np.sum(np.log(np.diag(whitening)))) - shot.log_volume)
    covariance = linalg.inv(curvature)
    return -covariance @ slope, covariance, np.array(scores)

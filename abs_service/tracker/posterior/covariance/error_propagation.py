"""Covariance of Θ over time: directions that no measurement determines become less certain from frame to frame.

The search starts every frame anew from the prediction of the motion prior with precision W (`priors`). To first order,
the estimate's error e is

    e_t = G (e_{t−1} + q_t + v_t) + Σ s_t,    G = Σ W,    Σ = (JᵀJ + P + W)⁻¹,

with the motion since the frame before that was not predicted, q and v, and the score s of the measurements and of the
other priors P, whose covariance is F + L (`sandwich`). Where the sensors outweigh W, G is zero and nothing of the past
is left. Where nothing is measured, G is one, and the errors add up:

- q is independent from frame to frame and has the covariance Q of the innovations less their noise (`innovations`).
- Where nothing is measured, the velocity is not known either, and the whole motion counts, with a covariance U. An
  object goes on moving as it does: the velocity lasts as long as the motion prior takes it to last,
  v_t = ρ v_{t−1} + n_t.
- A part of s is the same in every frame, with the covariance L: the noise of the first frame in mesh and appearance
  (`LastingShares`), and the error of whole sides of the outline. Its error is R_t s with R_t = G R_{t−1} + Σ. The rest
  is this frame's own noise, with the covariance F, and independent.

With the covariances E of the error by q, v and the frame's own noise, V of v, and C of that error with v:

    V ← ρ² V + (1 − ρ²) U
    E ← G (E + ρ (C + Cᵀ) + V + Q) Gᵀ + Σ F Σ
    C ← G (ρ C + V)

and the estimate has the covariance E + R L Rᵀ.

A mesh that is made from the first frame has no error before it: that frame defines the material points. A template has
the error of its registration (`registration_error`).

What lasts of the residuals r of the same points shows in successive frames: their correlation
Σ r_t r_{t−1} / √(Σ r_t² Σ r_{t−1}²) is the share of their variance that is the same. What the model cannot follow lasts
as well. Averages of distances that a mesh keeps from its first frame leave next to nothing, colours of that frame a
third; of a real sheet's distances nine tenths last.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.linearized_cost import Sensed
from abs_service.tracker.terms.linearization import Part, PointLinearization

#: Lasting share before residuals show one, and of those that have no points: of an outline, and of priors. Colours of
#: the first frame are interpolated between four pixels, which leaves 4/9 of their variance on average (a share of
#: 0.31); its distances are averaged over more (about 0.1).
LASTING = 0.25

#: Weight of a new frame in the running means, of which the lasting share is the ratio.
MEMORY = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Unpredicted motion of the object since the frame before.

    Attributes:
        unpredicted: covariance Q (dim, dim) where measurements show the object's velocity.
        unobserved: covariance U (dim, dim) of the whole motion, as far as nothing shows it.
        persistence: share ρ of a velocity that is left in the next frame, 0…1.
    """

    unpredicted: NDArray[np.float64]
    unobserved: NDArray[np.float64]
    persistence: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameErrors:
    """The cost of one frame at the estimate, and the covariance of its gradient.

    Attributes:
        inverse: Σ (dim, dim).
        precision: W (dim, dim).
        own: F (dim, dim), by errors of this frame alone.
        lasting: L (dim, dim), by errors that are equal in all frames.
    """

    inverse: NDArray[np.float64]
    precision: NDArray[np.float64]
    own: NDArray[np.float64]
    lasting: NDArray[np.float64]


class ErrorPropagation:
    """Covariance of Θ in each frame, from that of the frame before.

    Args:
        covariance: of the error before the first frame (dim, dim).
    """

    def __init__(self, covariance: NDArray[np.float64]):
        self.restart(covariance)

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Restarts with errors of a covariance (dim, dim), after a relocation."""
        self._error = covariance  # E
        self._velocity, self._cross, self._response = (np.zeros_like(covariance) for _ in range(3))  # V, C, R
        self._began = False

    def update(self, motion: Motion, errors: FrameErrors) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the estimate of a frame."""
        inverse = errors.inverse
        gain = inverse @ errors.precision
        if self._began:
            self._move(motion)
        self._began = True
        self._error, self._cross = gain @ self._error @ gain.T, gain @ self._cross
        self._error += inverse @ errors.own @ inverse
        self._response = gain @ self._response + inverse
        return self._response @ errors.lasting @ self._response.T + self._error

    def _move(self, motion: Motion) -> None:
        """Adds the motion since the frame before."""
        rho = motion.persistence
        new = 1 - rho**2 if self._velocity.any() else 1.0  # share of the motion that is not that of before
        self._velocity = rho**2 * self._velocity + new * motion.unobserved
        cross = rho * self._cross
        self._error = self._error + cross + cross.T + self._velocity + motion.unpredicted
        self._cross = cross + self._velocity


class LastingShares:
    """Lasting share of every source of residuals, as a running mean over the frames."""

    def __init__(self) -> None:
        self._sums = np.zeros((0, 2))  # product of successive residuals, and their mean square
        self._last: list[NDArray[np.float64]] = []

    def update(self, sensed: Sensed) -> NDArray[np.float64]:
        """Lasting share (sources,) of every source after another frame, 0…1.

        Args:
            sensed: residuals of every source.
        """
        if len(self._last) != len(sensed):  # a sensor came or went
            self._sums, self._last = np.zeros((len(sensed), 2)), [np.zeros(0)] * len(sensed)
        for source, part in enumerate(sensed):
            last, now = self._last[source], _at_points(part)
            self._last[source] = now
            if now.shape == last.shape and now.size:
                self._add(source, last, now)
        product, square = self._sums.T
        return np.clip(np.where(square > 0, product / np.where(square > 0, square, 1.0), LASTING), 0.0, 1.0)

    def _add(self, source: int, last: NDArray[np.float64], now: NDArray[np.float64]) -> None:
        """Takes residuals (n,) of the same points in two successive frames in; zero where there are none."""
        both = (last != 0) & (now != 0)
        square = np.sqrt(float(last[both] @ last[both]) * float(now[both] @ now[both]))
        new = np.array([float(last[both] @ now[both]), square])
        if not self._sums[source, 1]:
            self._sums[source] = LASTING * square, square
        self._sums[source] += MEMORY * (new - self._sums[source])


def _at_points(part: Part) -> NDArray[np.float64]:
    """Sum of the residuals at each point (n,); (0,) for residuals that belong to no points."""
    if not isinstance(part, PointLinearization):
        return np.zeros(0)
    return np.bincount(part.points, part.residual, len(part.sparse_jacobian.local)).astype(np.float64)

"""Covariance of Θ over time: directions that no measurement determines become less certain from frame to frame.

The search starts every frame anew from the prediction of the motion prior with precision W (`priors`). To first order,
the estimate's error e is

    e_t = G (e_{t−1} + q_t + v_t) + Σ s_t,    G = Σ W,    Σ = (JᵀJ + P + W)⁻¹,

with the motion since the frame before that was not predicted, q and v, and the score s of the measurements and of the
other priors P, whose covariance is B − W (`sandwich`). Where the sensors outweigh W, G is zero and nothing of the past
is left. Where nothing is measured, G is one, and the errors add up:

- q is independent from frame to frame and has the covariance Q of the innovations less their noise (`innovations`).
- Where nothing is measured, the velocity is not known either, and the whole motion counts, with a covariance U. An
  object goes on moving as it does: the velocity lasts as long as the motion prior takes it to last,
  v_t = ρ v_{t−1} + n_t.
- A share λ (`LASTING`) of the variance of s is the same in every frame: the noise of the first frame in mesh and
  appearance. So is that of whole sides of the outline, with a covariance B₀. The error of both is R_t s with
  R_t = G R_{t−1} + Σ. The rest is this frame's own noise, and independent.

With the covariances E of the error by q, v and the frame's own noise, V of v, and C of that error with v:

    V ← ρ² V + (1 − ρ²) U
    E ← G (E + ρ (C + Cᵀ) + V + Q) Gᵀ + (1 − λ) Σ (B − W) Σ
    C ← G (ρ C + V)

and the estimate has the covariance E + R (λ (B − W) + B₀) Rᵀ.

A mesh that is made from the first frame has no error before it: that frame defines the material points. A template has
the error of its registration (`registration_error`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Share λ of a residual's variance that comes from the first frame. Its colours are interpolated between four pixels,
#: which leaves 4/9 of their variance on average (a share of 0.31); its distances are averaged over more (about 0.1).
LASTING = 0.25


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
        gradient: B (dim, dim), W included.
        shared: B₀ (dim, dim), of errors that are equal in all frames.
    """

    inverse: NDArray[np.float64]
    precision: NDArray[np.float64]
    gradient: NDArray[np.float64]
    shared: NDArray[np.float64]


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
        inverse, own = errors.inverse, errors.gradient - errors.precision
        gain = inverse @ errors.precision
        if self._began:
            self._move(motion)
        self._began = True
        self._error, self._cross = gain @ self._error @ gain.T, gain @ self._cross
        self._error += (1 - LASTING) * inverse @ own @ inverse
        self._response = gain @ self._response + inverse
        return self._response @ (LASTING * own + errors.shared) @ self._response.T + self._error

    def _move(self, motion: Motion) -> None:
        """Adds the motion since the frame before."""
        rho = motion.persistence
        new = 1 - rho**2 if self._velocity.any() else 1.0  # share of the motion that is not that of before
        self._velocity = rho**2 * self._velocity + new * motion.unobserved
        cross = rho * self._cross
        self._error = self._error + cross + cross.T + self._velocity + motion.unpredicted
        self._cross = cross + self._velocity

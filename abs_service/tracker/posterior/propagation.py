"""Covariance of Θ over time: directions that no measurement holds become less certain from frame to frame.

The search starts every frame anew from the prediction of the motion prior with precision W (`priors`). To first order,
the estimate's error e_t is

    e_t = G (e_{t−1} + q_t) + Σ s_t,    G = Σ W,    Σ = (JᵀJ + P + W)⁻¹,

with what the object has done since the frame before, q, and the score s of the measurements and of the other priors P,
whose covariance is B (`covariance`). Where the sensors outweigh W, G is zero and nothing of the past is left. Where
nothing is measured, G is one, and the errors add up:

- q, the motion that was not predicted, has the size of the innovations less their noise (`innovations`). Where nothing
  is measured, the velocity is not known either, and the whole motion counts. An object goes on moving as it does: the
  velocity lasts as long as the motion prior takes it to last, v_t = ρ v_{t−1} + n_t.
- A share `LASTING` of the variance of s is the same in every frame: the noise of the first frame in mesh and
  appearance. Its error is R_t s with R_t = G R_{t−1} + Σ. So is that of whole sides of the outline. The rest is this
  frame's own noise, and independent.

A mesh that is made from the first frame has no error before it: that frame defines the material points. A template has
the error of its registration (`placement`).
"""

import numpy as np
from numpy.typing import NDArray

#: Share of a residual's variance that comes from the first frame. Its colours are interpolated between four pixels,
#: which leaves 4/9 of their variance on average (a share of 0.31); its distances are averaged over more (about 0.1).
LASTING = 0.25


class ErrorPropagation:
    """Covariance of Θ in each frame, from that of the frame before.

    Args:
        covariance: of the error before the first frame (dim, dim).
    """

    def __init__(self, covariance: NDArray[np.float64]):
        self._moved = covariance  # of the error due to q and to what was before the first frame
        self._motion = np.zeros_like(self._moved)  # of the motion that nothing shows
        self._together = np.zeros_like(self._moved)  # of that error with this motion
        self._response = np.zeros_like(self._moved)  # R
        self._began = False

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Restarts with errors of a covariance (dim, dim), after a relocation."""
        self._moved, self._began = covariance, False
        self._motion, self._together, self._response = (np.zeros_like(covariance) for _ in range(3))

    def update(
        self,
        unpredicted: NDArray[np.float64],
        moved: NDArray[np.float64],
        persistence: float,
        inverse: NDArray[np.float64],
        scores: NDArray[np.float64],
        shared: NDArray[np.float64],
        precision: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the estimate of a frame.

        Args:
            unpredicted: covariance (dim, dim) of the motion where measurements show the object's velocity.
            moved: that of the whole motion, as far as nothing shows it.
            persistence: share ρ of a velocity that is left in the next frame, 0…1.
            inverse: Σ (dim, dim).
            scores: covariance (dim, dim) of the gradient, W included.
            shared: the same of errors that are equal in all frames.
            precision: W (dim, dim).
        """
        gain = inverse @ precision
        if self._began:
            self._move(unpredicted, moved, persistence)
        self._began = True
        self._moved, self._together = gain @ self._moved @ gain.T, gain @ self._together
        own = scores - precision
        self._moved += (1 - LASTING) * inverse @ own @ inverse
        self._response = gain @ self._response + inverse
        return self._response @ (LASTING * own + shared) @ self._response.T + self._moved

    def _move(self, unpredicted: NDArray[np.float64], moved: NDArray[np.float64], persistence: float) -> None:
        """Adds the motion since the frame before; see `update`."""
        started = self._motion.any()
        self._motion = persistence**2 * self._motion + (1 - persistence**2 if started else 1.0) * moved
        before = persistence * self._together
        self._moved = self._moved + before + before.T + self._motion + unpredicted
        self._together = before + self._motion

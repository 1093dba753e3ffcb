"""Covariance of Θ over time: directions that no measurement holds become less certain from frame to frame.

The search starts every frame anew from the prediction of the motion prior with precision W (`priors`). To first order,
the estimate's error e_t is

    e_t = G (e_{t−1} + q_t) + Σ s_t,    G = Σ W,    Σ = (JᵀJ + P + W)⁻¹,

with what the object has done since the frame before, q, and the score s of the measurements and of the other priors P,
whose covariance is B (`covariance`). Where the sensors outweigh W, G is zero and nothing of the past is left. Where
nothing is measured, G is one, and the errors add up:

- q is independent from frame to frame. Its variance adapts to the motion: the mean squared change of the parameters, in
  the unit of their scales, over the last frames.
- s is not: the noise of the first frame in mesh and appearance, and the misfit of the model, are the same in every
  frame. Taken as equal in all frames, their error is R_t s with R_t = G R_{t−1} + Σ.

The first frame has no error before it: it defines the material points.
"""

import numpy as np
from numpy.typing import NDArray

#: Weight of a new frame in the running mean of the squared motion.
MEMORY = 0.1

#: Least motion of the surface between two frames [m].
LEAST_M = 1e-4


class ErrorPropagation:
    """Covariance of Θ in each frame, from that of the frame before.

    Args:
        scales: change (dim,) of each parameter that moves the surface by about one metre.
    """

    def __init__(self, scales: NDArray[np.float64]):
        self._scales = scales
        self._moved = np.zeros((len(scales), len(scales)))  # covariance of the error due to q
        self._response = np.zeros_like(self._moved)  # R
        self._last: NDArray[np.float64] | None = None
        self._motion = 0.0

    def restart(self, deviation: NDArray[np.float64]) -> None:
        """Restarts with independent errors of a standard deviation (dim,), after a relocation."""
        self._moved, self._response, self._last = np.diag(deviation**2), np.zeros_like(self._moved), None

    def update(
        self,
        theta: NDArray[np.float64],
        inverse: NDArray[np.float64],
        scores: NDArray[np.float64],
        precision: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the estimate of a frame.

        Args:
            theta: the estimate (dim,).
            inverse: Σ (dim, dim).
            scores: covariance (dim, dim) of the gradient, W included.
            precision: diagonal (dim,) of W.
        """
        if self._last is not None:
            motion = float(np.mean(((theta - self._last) / self._scales) ** 2))
            self._motion += (MEMORY if self._motion else 1.0) * (motion - self._motion)
            self._moved.flat[:: len(theta) + 1] += max(self._motion, LEAST_M**2) * self._scales**2
        self._last = theta
        gain = inverse * precision
        self._moved = gain @ self._moved @ gain.T
        self._response = gain @ self._response + inverse
        own = scores.copy()
        own.flat[:: len(theta) + 1] -= precision
        return self._response @ own @ self._response.T + self._moved

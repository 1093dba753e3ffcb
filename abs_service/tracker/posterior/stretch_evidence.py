"""Evidence for the scale of the stretch prior: a surface may stretch by far more than `priors.stretch` says.

What measurements force a mesh to stretch by tells how far it may have stretched where none of them shows it. Let E be
the sum of the edges' squared normalised length changes at an optimum. A prior whose deviation is s times that of the
setting has most evidence at

    s² = E(s) / γ(s),    γ(s) = tr(X N),    X = (N + H / s²)⁻¹

(MacKay, Bayesian interpolation, Neural Computation 4, 1992) with the information N of the measurements and the
curvature H of the prior as it is set; γ is the number of directions that measurements determine. The estimate keeps
that prior. To first order X g (1 − 1 / s²) leads from it to the optimum under the other one, g being the gradient of
the prior.

The gradient of the prior at the true Θ has the covariance s² H then, instead of H (`sandwich`).

s is not below one: a sheet of rubber that nothing has stretched yet looks like paper.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.curvature import Quadratic, gauss_newton, posterior_covariance
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.optimum import Optimum

#: The prior as it is set holds while E is within this number of deviations of what it is by chance, χ² of γ
#: directions. Three more than chance takes: a few control points have to stretch to bend.
CERTAIN = 6.0

#: Deviation of an edge's relative change of length that is not exceeded: rubber's.
MAX_DEVIATION = 0.2

#: Most steps of a frame towards the scale of most evidence, a fixed point that many of them approach, and relative
#: change of s² that is no step.
STEPS, MIN_CHANGE = 4, 0.05

#: N is not less than what a second without measurements would leave of a place [s].
UNSEEN_S = 1.0


class StretchEvidence:
    """The scale of most evidence, approached from frame to frame."""

    def __init__(self) -> None:
        self._square = 1.0  # s²

    def excess(self, optimum: Optimum, frame: FramePosterior) -> NDArray[np.float64]:
        """Covariance of the prior's gradient beyond H: (s² − 1) H (dim, dim), or zero (1, 1)."""
        near, energy = optimum.linearized, 2 * float(frame.stretch.cost(optimum.surface)[0])
        # The curvature has the motion prior in it: without that, no fewer directions are determined.
        determined = max(len(optimum.theta) - float(np.vdot(optimum.inverse_curvature, near.priors)), 0.0)
        if energy <= determined + CERTAIN * np.sqrt(2 * determined):
            self._square = 1.0
            return np.zeros((1, 1))
        stretch = gauss_newton(frame.stretch.linearize(optimum.surface, near.sparse_jacobian), len(optimum.theta))
        known = near.quadratic.curvature - near.priors + frame.motion.unseen_precision(UNSEEN_S)
        widest = max(MAX_DEVIATION / frame.stretch.deviation, 1.0) ** 2
        for _ in range(STEPS):
            inverse = posterior_covariance(Quadratic(stretch.gradient, known + stretch.curvature / self._square))
            step = inverse @ stretch.gradient * (1 - 1 / self._square)
            ratio = (energy + step @ (2 * stretch.gradient + stretch.curvature @ step)) / np.vdot(inverse, known)
            before, self._square = self._square, float(np.clip(ratio, 1.0, widest))
            if abs(self._square - before) < MIN_CHANGE * before:
                break
        return (self._square - 1) * stretch.curvature

"""The heavy elastica: the shape of a strip that is clamped at one end and bends under its own weight.

Equilibrium of the moments, D κ(s) = ∫ₛᴸ w (h(σ) − h(s)) dσ, gives D dκ/ds = −w (L − s) cos φ with κ = dφ/ds and a free
end, κ(L) = 0 (W. G. Bickley, The heavy elastica, Phil. Mag. 17, 1934; L. D. Landau, E. M. Lifshitz, Theory of
Elasticity, § 19). Valid for large slopes; the strip is uniform, straight without load, and at rest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.jit import kernel

#: Integration steps along the strip; of fourth order, so that the error is below 1e-6 up to a load of 60.
STEPS = 64


@dataclass(frozen=True, eq=False)
class Elastica:
    """Shapes of strips of unit length, one per row; nodes from the clamp to the free end in equal steps.

    Attributes:
        inclination: φ (m, STEPS + 1): angle of the tangent from the horizontal towards gravity [rad].
        points: horizontal and downward coordinates (m, STEPS + 1, 2) relative to the clamp.
    """

    inclination: NDArray[np.float64]
    points: NDArray[np.float64]


def heavy_elastica(tip: ArrayLike, load: ArrayLike) -> Elastica:
    """Integrates from the free end, where only the inclination is unknown, so that no shooting method is needed.

    Args:
        tip: inclination (m,) at the free end [rad].
        load: w L³ / D (m,), weight per area times length cubed over the bending stiffness per width; no unit.
    """
    tip, load = (np.array(a, np.float64) for a in np.broadcast_arrays(np.atleast_1d(tip), load))
    nodes = np.zeros((len(tip), STEPS + 1, 4))
    nodes[:, STEPS, 0] = tip
    _integrate(load, nodes)
    return Elastica(nodes[..., 0], nodes[..., 2:] - nodes[:, :1, 2:])


@kernel
def _integrate(load: NDArray[np.float64], nodes: NDArray[np.float64]) -> None:
    """Fourth-order Runge-Kutta steps; nodes (m, STEPS + 1, 4) are φ, κ and two coordinates, the last node given."""
    last = nodes.shape[1] - 1
    h = 1.0 / last
    for m in range(nodes.shape[0]):
        w = load[m]
        for i in range(last, 0, -1):
            u = (last - i) * h
            phi, kappa = nodes[m, i, 0], nodes[m, i, 1]
            a_1, b_1, x_1, y_1 = -kappa, w * u * np.cos(phi), -np.cos(phi), -np.sin(phi)
            p = phi + 0.5 * h * a_1
            a_2, b_2, x_2, y_2 = -(kappa + 0.5 * h * b_1), w * (u + 0.5 * h) * np.cos(p), -np.cos(p), -np.sin(p)
            p = phi + 0.5 * h * a_2
            a_3, b_3, x_3, y_3 = -(kappa + 0.5 * h * b_2), w * (u + 0.5 * h) * np.cos(p), -np.cos(p), -np.sin(p)
            p = phi + h * a_3
            a_4, b_4, x_4, y_4 = -(kappa + h * b_3), w * (u + h) * np.cos(p), -np.cos(p), -np.sin(p)
            nodes[m, i - 1, 0] = phi + h / 6 * (a_1 + 2 * a_2 + 2 * a_3 + a_4)
            nodes[m, i - 1, 1] = kappa + h / 6 * (b_1 + 2 * b_2 + 2 * b_3 + b_4)
            nodes[m, i - 1, 2] = nodes[m, i, 2] + h / 6 * (x_1 + 2 * x_2 + 2 * x_3 + x_4)
            nodes[m, i - 1, 3] = nodes[m, i, 3] + h / 6 * (y_1 + 2 * y_2 + 2 * y_3 + y_4)

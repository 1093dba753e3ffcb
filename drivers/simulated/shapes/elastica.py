"""The heavy elastica: the exact shape of a thin elastic strip that is clamped at one end and sags under its weight.

Planar equilibrium of an inextensible rod of linear bending stiffness, for arbitrarily large bends (W. G. Bickley,
"The heavy elastica", Philosophical Magazine 17, 1934). Let ψ be the angle between the strip and the vertical at the
distance s from the clamp, B the bending stiffness and q the weight per length, both for the same width. The moment
−B dψ/ds is that of all that hangs beyond s, so

    B d²ψ/ds² = q (L − s) sin ψ,    ψ(0) = ψ₀ at the clamp,    dψ/ds(L) = 0 at the free end.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from calib.jit import kernel

#: Steps of the integration, and number of them in one chord of the profile.
_STEPS, _CHORD = 512, 4


@dataclass(frozen=True, eq=False)
class Profile:
    """The strip seen from its side, as nodes at equal distances along it, from the clamp to the free end.

    Attributes:
        s: distance from the clamp along the strip, (n,) [m].
        reach: horizontal distance from the clamp, (n,) [m].
        drop: distance below the clamp, (n,) [m].
        angle: between the strip and the vertical, (n,) [rad].
    """

    s: NDArray[np.float64]
    reach: NDArray[np.float64]
    drop: NDArray[np.float64]
    angle: NDArray[np.float64]


def solve_elastica(length: float, load: float, clamp: float) -> Profile:
    """The shape of a strip.

    The equation is integrated from the free end, where the angle is searched for with which the clamp's comes out. The
    clamp's angle grows with it, so there is one solution. The nodes lie on the curve.

    Args:
        length: of the strip [m].
        load: weight per area over bending stiffness per width, q/B [1/m³].
        clamp: angle between the clamped end and the vertical, above 0 and below π/2 [rad].
    """
    step = length / _STEPS
    free = scipy.optimize.brentq(
        lambda angle: integrate_elastica(angle, step, load, _STEPS)[-1, 0] - clamp, 0.0, clamp, xtol=1e-15
    )
    nodes = integrate_elastica(free, step, load, _STEPS)[::-_CHORD]
    angle, reach, drop = nodes[:, 0], nodes[0, 2] - nodes[:, 2], nodes[0, 3] - nodes[:, 3]
    return Profile(np.linspace(0, length, len(nodes)), reach, drop, angle)


@kernel
def integrate_elastica(angle: float, step: float, load: float, steps: int) -> NDArray[np.float64]:
    """Follows the strip from its free end, by the Runge–Kutta method of fourth order.

    Args:
        angle: at the free end [rad].
        step: length of a step [m].
        load: as of `solve_elastica` [1/m³].
        steps: how many.

    Returns:
        (steps + 1, 4): angle [rad], its derivative [rad/m], reach and drop since the free end [m], at every step.
    """
    nodes = np.zeros((steps + 1, 4))
    psi, slope, reach, drop = angle, 0.0, 0.0, 0.0
    nodes[0, 0] = psi
    for i in range(steps):
        u, half = i * step, 0.5 * step
        k1, m1 = slope, load * u * np.sin(psi)
        psi2 = psi + half * k1
        k2, m2 = slope + half * m1, load * (u + half) * np.sin(psi2)
        psi3 = psi + half * k2
        k3, m3 = slope + half * m2, load * (u + half) * np.sin(psi3)
        psi4 = psi + step * k3
        k4, m4 = slope + step * m3, load * (u + step) * np.sin(psi4)
        reach += step / 6 * (np.sin(psi) + 2 * np.sin(psi2) + 2 * np.sin(psi3) + np.sin(psi4))
        drop += step / 6 * (np.cos(psi) + 2 * np.cos(psi2) + 2 * np.cos(psi3) + np.cos(psi4))
        psi += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        slope += step / 6 * (m1 + 2 * m2 + 2 * m3 + m4)
        nodes[i + 1, 0], nodes[i + 1, 1], nodes[i + 1, 2], nodes[i + 1, 3] = psi, slope, reach, drop
    return nodes

"""Arcs of constant curvature in the complex plane: they begin at 0 along the real axis and bend towards the imaginary.

exp(iα) times an arc is one that begins in the direction α, so that arcs which go on from each other are sums.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Bend [rad] below which series are closer than quotients of rounded differences; either errs by less than 1e-9.
SMALL = 1e-3


def arc(bend: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """End of an arc of length one, ∫ exp(i bend t) dt from 0 to 1, and its derivative by the bend (…) [rad]."""
    b = np.asarray(bend, np.float64)
    small = np.abs(b) < SMALL
    divisor = np.where(small, 1.0, b)
    turn = np.exp(1j * b)
    end = np.where(small, 1 + 0.5j * b - b**2 / 6, (turn - 1) / (1j * divisor))
    slope = np.where(small, 0.5j - b / 3 - 0.125j * b**2, (turn - end) / divisor)
    return end, slope

"""Arcs of constant curvature in the complex plane: they start at 0 along the real axis, bend towards the imaginary one.

exp(iα) times an arc starts in the direction α, so concatenated arcs are sums.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.jit import kernel

#: Bend [rad] below which the series is more accurate than the closed form; the error of either is below 1e-9.
SMALL = 1e-3


def arc(bend: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """End point of an arc of unit length, ∫ exp(i bend t) dt from 0 to 1, and its derivative with respect to the bend.

    Both have the shape (…) of the bend [rad].
    """
    bends = np.asarray(bend, np.float64)
    end, derivative = np.empty(bends.shape, np.complex128), np.empty(bends.shape, np.complex128)
    _ends(bends.reshape(-1), end.reshape(-1), derivative.reshape(-1))
    return end, derivative


@kernel
def _ends(bends: NDArray[np.float64], ends: NDArray[np.complex128], derivatives: NDArray[np.complex128]) -> None:
    for k in range(bends.size):
        ends[k], derivatives[k] = end_of(bends[k])


@kernel
def end_of(bend: float) -> tuple[complex, complex]:
    """End of an arc and its derivative for one bend; see `arc`."""
    if abs(bend) < SMALL:
        return 1 - bend * bend / 6 + 0.5j * bend, -bend / 3 + 1j * (0.5 - 0.125 * bend * bend)
    turn = np.cos(bend) + 1j * np.sin(bend)
    end = (turn - 1) / (1j * bend)
    return end, (turn - end) / bend

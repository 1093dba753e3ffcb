"""Detection of parameters that the measurements do not determine, by name."""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

#: Smallest eigenvalue of the correlation form of the curvature; smaller ones are rounding errors.
MIN_EIGENVALUE = 1e-13

#: Parameters with at least this share of the null direction are named.
SHARE = 0.2


class UndeterminedError(ValueError):
    """Parameters that the measurements do not determine; `names` are theirs."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        listed = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
        super().__init__(
            f"the views do not determine {listed}: take more views with the board tilted in several directions and at "
            "several distances, or keep these parameters fixed"
        )


def require_touched(curvature: NDArray[np.float64], names: tuple[str, ...]) -> NDArray[np.float64]:
    """Curvature (n, n), checked for parameters that change no residual.

    Raises:
        UndeterminedError: with the names of those parameters.
    """
    untouched = [name for name, value in zip(names, np.diag(curvature), strict=True) if not value > 0]
    if untouched:
        raise UndeterminedError(untouched)
    return curvature


def require_determined(curvature: NDArray[np.float64], names: tuple[str, ...]) -> NDArray[np.float64]:
    """Curvature (n, n) of the normalised residuals, checked for full rank.

    Raises:
        UndeterminedError: with the names of the undetermined parameters.
    """
    size = np.sqrt(np.diag(require_touched(curvature, names)))
    values, directions = linalg.eigh(curvature / np.outer(size, size))
    if values[0] < MIN_EIGENVALUE:
        shares = np.abs(directions[:, 0]) / np.abs(directions[:, 0]).max()
        order = np.argsort(-shares)
        raise UndeterminedError([names[index] for index in order if shares[index] >= SHARE])
    return curvature

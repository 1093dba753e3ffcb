"""Says by name which parameters the measurements leave open, before anything is divided by zero."""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

#: Least eigenvalue of the correlation form of the curvature; less is rounding.
LEAST_EIGENVALUE = 1e-13

#: Parameters with at least this share of the direction that is open are named.
SHARE = 0.2


class UndeterminedError(ValueError):
    """Measurements that leave parameters open; `names` are theirs."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        listed = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
        super().__init__(
            f"the views do not determine {listed}: take more views with the board tilted in several directions and at "
            "several distances, or keep these parameters fixed"
        )


def require_touched(curvature: NDArray[np.float64], names: tuple[str, ...]) -> NDArray[np.float64]:
    """The curvature (n, n), if every parameter changes some residual: enough to begin a search with.

    Raises:
        UndeterminedError: with the names of those that change none.
    """
    untouched = [name for name, value in zip(names, np.diag(curvature), strict=True) if not value > 0]
    if untouched:
        raise UndeterminedError(untouched)
    return curvature


def require_determined(curvature: NDArray[np.float64], names: tuple[str, ...]) -> NDArray[np.float64]:
    """The curvature (n, n) of the whitened residuals, if it determines all parameters.

    Raises:
        UndeterminedError: with the names of those that it does not.
    """
    size = np.sqrt(np.diag(require_touched(curvature, names)))
    values, directions = linalg.eigh(curvature / np.outer(size, size))
    if values[0] < LEAST_EIGENVALUE:
        shares = np.abs(directions[:, 0]) / np.abs(directions[:, 0]).max()
        order = np.argsort(-shares)
        raise UndeterminedError([names[index] for index in order if shares[index] >= SHARE])
    return curvature

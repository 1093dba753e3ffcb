"""Median of a few hundred numbers, of which a frame needs a dozen."""

import numpy as np
from numpy.typing import NDArray


def median(values: NDArray[np.floating]) -> float:
    """Median of known values (k,), at least one; `numpy.median`, which looks for unknown ones, takes thrice as long."""
    lower, upper = (values.size - 1) // 2, values.size // 2
    ordered = values.copy()
    ordered.partition((lower, upper))
    return float((ordered[lower] + ordered[upper]) / 2)

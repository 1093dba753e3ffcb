"""Arrays of region and pixel polynomials in an .npz file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.files import limited
from calib.noise.base import NoiseError

#: Lower bound of the deviation in files without `minimum_sigma` [m].
MIN_SIGMA = 1e-4


def load(file: Path, required: set[str]) -> dict[str, NDArray[np.float64]]:
    """Arrays of a file with `distances` and `amplitudes` (2,), the calibrated domain, and `minimum_sigma` () [m].

    Args:
        file: the .npz.
        required: names of further arrays that must be present.

    Raises:
        NoiseError: unreadable file, missing array, or invalid domain.
    """
    found = arrays(file, required | {"distances", "amplitudes"})
    for key in ("distances", "amplitudes"):
        check_domain(file, found, key)
    found["minimum_sigma"] = np.array(minimum_sigma(file, found))
    return found


def minimum_sigma(file: Path, found: dict[str, NDArray[np.float64]]) -> float:
    """Lower bound of the deviation in the arrays of a file [m], or the default one.

    Raises:
        NoiseError: it is not a number above 0.
    """
    minimum = found.get("minimum_sigma", np.array(MIN_SIGMA))
    if minimum.shape != () or not minimum > 0:
        raise NoiseError(f"minimum_sigma in {str(file)!r} must be a number above 0, not {minimum.tolist()}")
    return float(minimum)


def arrays(file: Path, required: set[str]) -> dict[str, NDArray[np.float64]]:
    """Arrays of an .npz file.

    Raises:
        NoiseError: unreadable file, or a required array is missing or, unless it is a domain, is no finite numbers.
    """
    try:
        found = limited.arrays(file)
    except (OSError, ValueError) as error:
        raise NoiseError(f"file = {str(file)!r} cannot be read as .npz: {error}") from error
    if missing := required - set(found):
        raise NoiseError(f"file = {str(file)!r} lacks the array(s) {sorted(missing)}")
    for key in sorted(required - {"distances", "amplitudes"}):
        if found[key].dtype.kind not in "iuf" or not np.all(np.isfinite(found[key])):
            raise NoiseError(f"{key} in {str(file)!r} must be finite numbers")
    return found


def check_domain(file: Path, found: dict[str, NDArray[np.float64]], key: str) -> None:
    """Checks that an array is [lowest, highest] with lowest < highest.

    Raises:
        NoiseError: it is not; names the file and the key.
    """
    if found[key].shape != (2,) or not found[key][0] < found[key][1]:
        raise NoiseError(f"{key} in {str(file)!r} must be [lowest, highest], not {found[key].tolist()}")

"""Noise polynomials of regions and pixels on disk: arrays in an .npz."""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from calib.noise.base import NoiseError

#: Lower bound of the deviation in files that do not say theirs [m].
_LEAST_SIGMA = 1e-4


def load(file: Path, required: set[str]) -> dict[str, NDArray[np.float64]]:
    """The arrays of a file with `distances` and `amplitudes` (2,), the calibrated domain, and `least_sigma` () [m].

    Args:
        file: the .npz.
        required: arrays that it must hold beside the domain.

    Raises:
        NoiseError: it cannot be read or lacks one, or the domain is none.
    """
    try:
        with file.open("rb") as stream, NpzFile(stream) as archive:
            arrays = dict(archive)
    except (OSError, ValueError, BadZipFile) as error:
        raise NoiseError(f"file = {str(file)!r} cannot be read as .npz: {error}") from error
    if missing := (required | {"distances", "amplitudes"}) - set(arrays):
        raise NoiseError(f"file = {str(file)!r} lacks the array(s) {sorted(missing)}")
    for key in ("distances", "amplitudes"):
        if arrays[key].shape != (2,) or not arrays[key][0] < arrays[key][1]:
            raise NoiseError(f"{key} in {str(file)!r} must be [lowest, highest], not {arrays[key].tolist()}")
    least = arrays.setdefault("least_sigma", np.array(_LEAST_SIGMA))
    if least.shape != () or not least > 0:
        raise NoiseError(f"least_sigma in {str(file)!r} must be a number above 0, not {least.tolist()}")
    return arrays

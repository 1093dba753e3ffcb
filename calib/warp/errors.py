"""Errors of warping, with their causes; a warp never returns an empty image."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: Largest plausible median distance [m]; a larger one indicates a wrong unit.
MAX_DISTANCE_M = 100.0

#: Largest plausible baseline, in metres and relative to the measured distances; beyond, T_rs has a wrong unit.
MAX_BASELINE_M, BASELINE_RATIO = 10.0, 10.0


class WarpError(ValueError):
    """Images or cameras that cannot be warped into each other."""


class NoReturnsError(WarpError):
    """Image without any distance."""


class NoOverlapError(WarpError):
    """Image of which no measurement is in the target's view."""


class UnitError(WarpError):
    """Distances or a pose that are not in metres."""


def check(distance: NDArray[np.floating], source: Camera, target: Camera) -> None:
    """Validates a distance image [m] of the source and the baseline.

    Raises:
        WarpError: wrong image size.
        NoReturnsError: no pixel has a distance.
        UnitError: distances or baseline are not in metres.
    """
    if distance.shape != (source.height, source.width):
        size = " × ".join(map(str, distance.shape[::-1]))
        raise WarpError(f"an image of {size} pixels is not one of the camera's {source.width} × {source.height}")
    known = _some(distance[::7, ::7])  # sufficient for a median
    known = _some(distance) if known.size == 0 else known
    if known.size == 0:
        raise NoReturnsError(f"none of the {source.width} × {source.height} pixels has a distance")
    median = float(np.median(known))
    baseline = float(np.linalg.norm(target.center - source.center))
    if not 0 < median < MAX_DISTANCE_M:
        raise UnitError(f"a median distance of {median:g} is no length in metres; were millimetres divided by 1000?")
    if baseline > max(MAX_BASELINE_M, BASELINE_RATIO * median):
        raise UnitError(
            f"the cameras would be {baseline:g} m apart, at distances of {median:g} m; is T_rs in millimetres?"
        )


def _some(distance: NDArray[np.floating]) -> NDArray[np.floating]:
    return distance[np.isfinite(distance)]


def nothing_seen(distance: NDArray[np.floating], inverse_z: NDArray[np.floating], target: Camera) -> NoOverlapError:
    """Error for distances [m] outside the target's view; `inverse_z` is NaN behind the target."""
    known = np.isfinite(distance)
    before = int(np.count_nonzero(np.isfinite(inverse_z)))
    return NoOverlapError(
        f"of {np.count_nonzero(known)} distances from {np.nanmin(distance):.3g} to {np.nanmax(distance):.3g} m none is "
        f"in the view of the target of {target.width} × {target.height} pixels: {before} lie before its camera but "
        f"beside its image, the others behind it or too far aside; check both T_rs"
    )

"""Why nothing can be warped, in words; a warping never returns an empty image."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: No depth sensor measures farther [m]; a median beyond is a length in another unit.
FARTHEST_M = 100.0

#: Cameras of one rig that are farther apart, and by so many times the distances measured, have a pose in another unit.
LONGEST_BASELINE_M, BASELINE_RATIO = 10.0, 10.0


class WarpError(ValueError):
    """Images or cameras that cannot be warped into each other."""


class NoReturnsError(WarpError):
    """The image has no distance at all."""


class NoOverlapError(WarpError):
    """Nothing that the one sensor measured is in the other's view."""


class UnitError(WarpError):
    """Distances or a pose are not in metres."""


def check(distance: NDArray[np.floating], source: Camera, target: Camera) -> None:
    """Refuses what is no distance image [m] of the source, or cannot be meant.

    Raises:
        WarpError: the image has another size.
        NoReturnsError: no pixel has a distance.
        UnitError: the distances, or the way from one camera to the other, are no metres.
    """
    if distance.shape != (source.height, source.width):
        size = " × ".join(map(str, distance.shape[::-1]))
        raise WarpError(f"an image of {size} pixels is not one of the camera's {source.width} × {source.height}")
    known = _some(distance[::7, ::7])  # enough for a median
    known = _some(distance) if known.size == 0 else known
    if known.size == 0:
        raise NoReturnsError(f"none of the {source.width} × {source.height} pixels has a distance")
    median = float(np.median(known))
    baseline = float(np.linalg.norm(target.center - source.center))
    if not 0 < median < FARTHEST_M:
        raise UnitError(f"a median distance of {median:g} is no length in metres; were millimetres divided by 1000?")
    if baseline > max(LONGEST_BASELINE_M, BASELINE_RATIO * median):
        raise UnitError(
            f"the cameras would be {baseline:g} m apart, at distances of {median:g} m; is T_rs in millimetres?"
        )


def _some(distance: NDArray[np.floating]) -> NDArray[np.floating]:
    return distance[np.isfinite(distance)]


def nothing_seen(distance: NDArray[np.floating], inverse_z: NDArray[np.floating], target: Camera) -> NoOverlapError:
    """What to say of distances [m] of which the target sees none; 1/z there is NaN where they are not before it."""
    known = np.isfinite(distance)
    before = int(np.count_nonzero(np.isfinite(inverse_z)))
    return NoOverlapError(
        f"of {np.count_nonzero(known)} distances from {np.nanmin(distance):.3g} to {np.nanmax(distance):.3g} m none is "
        f"in the view of the target of {target.width} × {target.height} pixels: {before} lie before its camera but "
        f"beside its image, the others behind it or too far aside; check both T_rs"
    )

"""Errors of warping, with their causes; a warp never returns an empty image."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.warp.points import Points

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


class NoSurfaceError(WarpError):
    """Image whose measurements in the target's view are single points, of no surface."""


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


def nothing_seen(points: Points, target: Camera, maximum_step_m: float) -> NoOverlapError | NoSurfaceError:
    """Error for points of which no surface is in the target's view."""
    known, before = np.isfinite(points.distance), np.isfinite(points.inverse_z)
    away = np.abs(points.place[before] - np.array([target.width - 1, target.height - 1]) / 2)
    inside = np.count_nonzero((away <= np.array([target.width, target.height]) / 2).all(axis=1))
    about = (
        f"of {np.count_nonzero(known)} distances from {np.nanmin(points.distance):.3g} to "
        f"{np.nanmax(points.distance):.3g} m "
    )
    if inside:
        return NoSurfaceError(
            f"{about}{inside} are in the view, but none of them with two neighbours within {maximum_step_m:g} m, which "
            "were a surface: the image is noise, or its surfaces are too small"
        )
    return NoOverlapError(
        f"{about}none is in the view of the target of {target.width} × {target.height} pixels: "
        f"{np.count_nonzero(before)} lie before its camera but beside its image, the others behind it or too far "
        "aside; check both T_rs"
    )

"""Tracking of a synthetic board, so that all kernels are called before the first real frame."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.detection.templates import first_image
from abs_service.tracking.observer import streams
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.warmup.ahead import NotCachedError, Progress, cached_only, compiled_ahead, ignore
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.rig import Noise, Rig, Sensor
from drivers.contract.frame import Frame, FrameSet, Geometry, Kind

#: Placeholder camera: kernels accept images of any size, and in a small one there is little to compute.
_CAMERA = Camera(160, 120, 200.0, 200.0, 79.5, 59.5)
#: Fewer vertices than a rig has: kernels take any number, and Python computes what is not compiled yet.
_VERTICES = 60
#: Placeholder for every depth noise, of which a per-pixel map would not fit the camera; a polynomial that is evaluated.
_NOISE = GaussianPolynomial(((0.01,), (1e-4,)))


def load_cached(noises: Mapping[str, Noise], plan: Plan) -> bool:
    """Loads kernels for cameras without distortion, before those are known; False if one was not in the cache."""
    try:
        with cached_only():
            _track_board({name: Sensor(name, _CAMERA, noise) for name, noise in noises.items()}, plan)
    except NotCachedError:
        return False
    return True


def is_undistorted(rig: Rig) -> bool:
    """True if all cameras are such as `load_cached` takes them for."""
    return all(sensor.camera.lens.is_pinhole for sensor in rig.sensors.values())


def warm_up(rig: Rig, plan: Plan, report: Callable[[Progress], None] = ignore) -> None:
    """Tracks and loses a synthetic flat board with the lenses of a rig and the parts of a plan.

    Kernels that are not in the cache yet are compiled by several processes; see `compiled_ahead`.

    Args:
        rig: the sensors of the tracker; their noise models determine the kinds of images.
        plan: settings of the tracker.
        report: called with the number of compiled kernels.
    """
    with compiled_ahead(report) as pool:
        _track_board(rig.sensors, plan)
    if pool.total:
        _track_board(rig.sensors, plan)


def _track_board(sensors: Mapping[str, Sensor], plan: Plan) -> None:
    rig = Rig("warm-up", {name: _sensor(sensor) for name, sensor in sensors.items()})
    frames = [_board(head, Kind(stream), plan.model.board) for head, stream in streams(rig.sensors.values())]
    small = replace(plan, region=nearest.Settings(), template=first_image.Settings(), vertices=_VERTICES)
    session = TrackingSession(rig, small)
    changed = [[change(frame) for frame in frames] for change in (_with_dropout, _moved, _without_object)]
    for seq, seen in enumerate((frames, *changed)):
        session.track(FrameSet(seq, round(seq * 33e6), {frame.key: frame for frame in seen}), lambda: False)


def _sensor(sensor: Sensor) -> Sensor:
    noise = _NOISE if isinstance(sensor.noise, DepthNoise) else sensor.noise
    return Sensor(sensor.name, replace(_CAMERA, lens=sensor.camera.lens), noise)


def _moved(frame: Frame) -> Frame:
    """The object has left a part of its place, before a background; in integers, as most devices deliver distances."""
    if frame.kind != Kind.DEPTH:
        return frame
    rows, columns = np.nonzero(np.isfinite(frame.data))
    away = np.ptp(rows) // 5, np.ptp(columns) // 5
    z = np.roll(np.nan_to_num(frame.data, nan=2 * float(np.nanmax(frame.data))), away, axis=(0, 1))
    return replace(frame, data=np.round(z / 1e-3).astype("<u2"), encoding="16UC1", scale=1e-3)


def _with_dropout(frame: Frame) -> Frame:
    if frame.kind != Kind.DEPTH:
        return frame
    z = frame.data.copy()
    z[z.shape[0] // 2, z.shape[1] // 2] = np.nan
    return replace(frame, data=z)


def _without_object(frame: Frame) -> Frame:
    return replace(frame, data=np.full_like(frame.data, np.nan)) if frame.kind == Kind.DEPTH else frame


def _board(head: str, kind: Kind, size: tuple[float, float]) -> Frame:
    """Frame of a flat board [m] that fills half the image; uniform grey images, and an uninterrupted beam."""
    height, width = _CAMERA.height, _CAMERA.width
    match kind:
        case Kind.DEPTH:
            z = np.full((height, width), np.nan, np.float32)
            away = 2 * max(size[0] * _CAMERA.fx / width, size[1] * _CAMERA.fy / height)
            right, down = round(size[0] * _CAMERA.fx / away / 2), round(size[1] * _CAMERA.fy / away / 2)
            z[height // 2 - down : height // 2 + down, width // 2 - right : width // 2 + right] = away
            return Frame(head, kind.value, kind, z, "32FC1", 0, 0, 0, geometry=Geometry.Z)
        case Kind.COLOR:
            return Frame(head, kind.value, kind, np.full((height, width, 3), 128, np.uint8), "rgb8", 0, 0, 0)
        case Kind.BAYER:
            return Frame(head, kind.value, kind, np.full((height, width), 128, np.uint8), "bayer_rggb8", 0, 0, 0)
        case Kind.BINARY:
            return Frame(head, kind.value, kind, np.zeros((height, width), np.uint8), "mono8", 0, 0, 0)
    return Frame(head, kind.value, kind, np.full((height, width), 3000, "<u2"), "16UC1", 0, 0, 0)

"""Tracking of a synthetic board, so that all kernels are called before the first real frame."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.detection.templates import first_image
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession, streams
from abs_service.tracking.warmup.ahead import Progress, compiled_ahead, ignore
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from calib.noise.base import DepthNoise
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.rig import Noise, Rig, Sensor
from drivers.contract.frame import Frame, FrameSet, Geometry, Kind

#: Placeholder camera: kernels accept images of any size, so the real cameras are not required yet.
_CAMERA = Camera(160, 120, 200.0, 200.0, 79.5, 59.5)
_DISTORTED = replace(_CAMERA, lens=Lens(np.array([-0.05])))
_FISHEYE = replace(_CAMERA, lens=KannalaBrandt())
#: Placeholder for every depth noise: kernels use its texture only, and a per-pixel map would not fit the camera.
_NOISE = GaussianPolynomial(((0.01,),))


def warm_up(noises: Mapping[str, Noise], plan: Plan, report: Callable[[Progress], None] = ignore) -> None:
    """Tracks and loses a synthetic flat board with every kind of lens and the parts of the plan.

    Kernels that are not in the cache yet are compiled by several processes; see `compiled_ahead`.

    Args:
        noises: noise model of every sensor of the tracker, by name; determines the kind of image.
        plan: settings of the tracker.
        report: told how many kernels are compiled.
    """
    with compiled_ahead(report) as pool:
        _track_board(noises, plan, _CAMERA)
    again = (_CAMERA,) if pool.total else ()
    for camera in (*again, _DISTORTED, _FISHEYE):
        _track_board(noises, plan, camera)


def _track_board(noises: Mapping[str, Noise], plan: Plan, camera: Camera) -> None:
    rig = Rig("warm-up", {name: _sensor(name, camera, noise) for name, noise in noises.items()})
    frames = [_board(head, Kind(stream), plan.model.board) for head, stream in streams(rig.sensors.values())]
    tracking = TrackingSession(rig, replace(plan, region=nearest.Settings(), template=first_image.Settings()))
    for seq, seen in enumerate((frames, frames, [_without_object(frame) for frame in frames])):
        tracking.track(FrameSet(seq, round(seq * 33e6), {frame.key: frame for frame in seen}), lambda: False)


def _sensor(name: str, camera: Camera, noise: Noise) -> Sensor:
    return Sensor(name, camera, _NOISE if isinstance(noise, DepthNoise) else noise)


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

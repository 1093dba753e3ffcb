"""Makes every kernel ready before the first real frame: compiled once per installation, then read from the cache."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from abs_service.images import ColorImage, DepthImage
from abs_service.observation import Observation, Source
from abs_service.tracker.regions import nearest
from abs_service.tracking import Plan, Tracking
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.color import GaussianColor
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.rig import Rig, Sensor

#: Stands for every camera: kernels take images of any size, so that nobody has to wait until the real ones are known.
_CAMERA = Camera(160, 120, 200.0, 200.0, 79.5, 59.5)
#: Stands for every noise of depth: kernels see its texture only, and a map of pixels would not fit the camera.
_NOISE = GaussianPolynomial(((0.01,),))
#: Distance of the board that is tracked [m].
_DISTANCE_M = 1.0


def warm_up(noises: Mapping[str, DepthNoise | GaussianColor], plan: Plan) -> None:
    """Tracks a flat board that no sensor ever saw, once, with the parts of the plan.

    Args:
        noises: noise model of every sensor that the tracker uses, by name; tells what kind of image it takes.
        plan: of the tracker.
    """
    rig = Rig("warm-up", {name: _sensor(name, noise) for name, noise in noises.items()})
    tracking = Tracking(rig, replace(plan, region=nearest.Settings()))
    tracking.track_observation(_board(rig), lambda: False)


def _sensor(name: str, noise: DepthNoise | GaussianColor) -> Sensor:
    return Sensor(name, _CAMERA, noise if isinstance(noise, GaussianColor) else _NOISE)


def _board(rig: Rig) -> Observation:
    """A flat board in the middle of every depth image, and grey colour images."""
    height, width = _CAMERA.height, _CAMERA.width
    distance = np.full((height, width), np.nan, np.float32)
    distance[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4] = _DISTANCE_M
    depth = DepthImage(distance, np.ones_like(distance))
    grey = ColorImage(np.full((height, width, 3), 128, np.uint8))
    images: dict[str, DepthImage | ColorImage] = {
        name: grey if isinstance(sensor.noise, GaussianColor) else depth for name, sensor in rig.sensors.items()
    }
    return Observation(0, 0, images, {name: Source(0, 0) for name in images}, ())

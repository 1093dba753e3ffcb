"""Makes every kernel ready before the first real frame: compiled once per installation, then read from the cache."""

from dataclasses import replace

import numpy as np

from abs_service.observation import ColorImage, DepthImage, Observation, Source
from abs_service.tracker.regions import nearest
from abs_service.tracking import Plan, Tracking
from calib.noise.color import GaussianColor
from calib.rig import Rig

#: Distance of the board that is tracked [m].
_DISTANCE_M = 1.0


def warm_up(rig: Rig, plan: Plan) -> None:
    """Tracks a flat board that no sensor ever saw, once, with the parts of the plan."""
    tracking = Tracking(rig, replace(plan, region=nearest.Settings()))
    tracking.track_observation(_board(rig), lambda: False)


def _board(rig: Rig) -> Observation:
    """A flat board in the middle of every depth image, and grey colour images."""
    images: dict[str, DepthImage | ColorImage] = {}
    for name, sensor in rig.sensors.items():
        height, width = sensor.camera.height, sensor.camera.width
        if isinstance(sensor.noise, GaussianColor):
            images[name] = ColorImage(np.full((height, width, 3), 128, np.uint8))
            continue
        distance = np.full((height, width), np.nan, np.float32)
        distance[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4] = _DISTANCE_M
        images[name] = DepthImage(distance, np.ones_like(distance))
    return Observation(0, 0, images, {name: Source(0, 0) for name in images}, ())

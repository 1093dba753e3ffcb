"""The object in the first frames: which pixels show it."""

import numpy as np

from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.initial_detection import Sighting, SightingError
from abs_service.tracker.detection.regions.base import Region
from calib.noise.base import DepthNoise, subtract_mean_offset
from calib.rig import Rig


def sight(observation: Observation, rig: Rig, reference: str, region: Region, vertices: int) -> Sighting:
    """The object that the region selects in the reference sensor's depth image, for a mesh of about `vertices`.

    Raises:
        SightingError: the reference sensor sees no object.
    """
    image, noise = observation.images.get(reference), rig.sensors[reference].noise
    if not (isinstance(image, DepthImage) and isinstance(noise, DepthNoise)):
        raise SightingError(f"no depth image from {reference} yet")
    camera = rig.sensors[reference].camera
    distance = subtract_mean_offset(noise, image.distance, image.amplitude)
    inside = region.select(camera.unproject(distance), distance)
    return Sighting(np.where(inside, distance, np.nan).astype(np.float32), camera, vertices, distance)

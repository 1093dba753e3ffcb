"""Segmentation of the object in a depth image by a region."""

import numpy as np

from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.regions.base import Region
from calib.noise.base import DepthNoise, subtract_mean_offset
from calib.rig import Rig


def detect_object(
    observation: Observation, rig: Rig, reference: str, region: Region, vertices: int
) -> InitialDetection:
    """Segments the reference sensor's depth image by a region, for a mesh of about `vertices` vertices.

    Raises:
        DetectionError: there is no depth image, or no object in it.
    """
    image, noise = observation.images.get(reference), rig.sensors[reference].noise
    if not (isinstance(image, DepthImage) and isinstance(noise, DepthNoise)):
        raise DetectionError(f"no depth image from {reference} yet")
    camera = rig.sensors[reference].camera
    distance = subtract_mean_offset(noise, image.distance, image.amplitude)
    inside = region.select(camera.unproject(distance), distance)
    return InitialDetection(np.where(inside, distance, np.nan).astype(np.float32), camera, vertices, distance)

"""Segmentation of the object in a depth image by a region."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ColorImage, DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker import resolution
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.plausibility import LARGEST_M, LARGEST_SCENE_M, MAX_POINTS, check_extent
from abs_service.tracker.detection.regions.base import Region
from calib.noise.base import DepthNoise, subtract_mean_offset
from calib.rig import Rig


def detect_object(
    observation: Observation, rig: Rig, reference: str, region: Region, vertices: resolution.Vertices
) -> InitialDetection:
    """Segments the reference sensor's depth image by a region, for a mesh of about `vertices` vertices.

    "auto" is the usual number, fewer if the object has fewer pixels.

    Raises:
        DetectionError: there is no depth image, or no object in it, or its size is impossible.
    """
    sensor, image = rig.sensors[reference], observation.images.get(reference)
    if not (isinstance(image, DepthImage) and isinstance(sensor.noise, DepthNoise)):
        raise DetectionError(f"no depth image from {reference} yet")
    distance = subtract_mean_offset(sensor.noise, image.distance, image.amplitude)
    pictures = [(rig.sensors[n].camera, i.rgb) for n, i in observation.images.items() if isinstance(i, ColorImage)]
    view = DepthView.of(distance, sensor.camera, pictures, observation.t_host_ns)
    check_extent(view.points_r[view.measured], "everything in sight", LARGEST_SCENE_M, sensor.head)
    inside = region.select(view)
    check_extent(view.points_r[inside], "the object", LARGEST_M, sensor.head)
    distance = np.where(inside, view.distance, np.nan).astype(np.float32)
    deviation = _median_deviation(sensor.noise, image, inside)
    count = resolution.vertices(int(np.isfinite(distance).sum())) if vertices == "auto" else vertices
    return InitialDetection(distance, sensor.camera, count, view.distance, deviation)


def _median_deviation(noise: DepthNoise, image: DepthImage, inside: NDArray[np.bool_]) -> float:
    """Median standard deviation [m] of the distances at the pixels of a mask (height, width), of some of them."""
    rows, columns = (places[:: np.count_nonzero(inside) // MAX_POINTS + 1] for places in np.nonzero(inside))
    distance, amplitude = (values[rows, columns].astype(np.float64) for values in (image.distance, image.amplitude))
    deviation = noise.deviation(distance, amplitude, (rows, columns))
    return float(np.nanmedian(deviation)) if np.isfinite(deviation).any() else 0.0

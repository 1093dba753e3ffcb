"""Segmentation of the object in a depth image by a region."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.regions.base import Region
from calib.noise.base import DepthNoise, subtract_mean_offset
from calib.rig import Rig

#: Range of the extent of an object [m]; outside, the distances have the wrong unit.
SMALLEST_M, LARGEST_M = 0.005, 20.0

#: The same for everything in sight, which is checked first: with the wrong unit, no region finds anything sensible.
LARGEST_SCENE_M = 200.0

#: Percentiles of the coordinates between which the extent is measured, because some pixels at the rim are wrong.
EXTENT_PERCENT = (2, 98)

#: Number of points for the extent; more are slower but not more accurate.
MOST_POINTS = 5000


def detect_object(
    observation: Observation, rig: Rig, reference: str, region: Region, vertices: int
) -> InitialDetection:
    """Segments the reference sensor's depth image by a region, for a mesh of about `vertices` vertices.

    Raises:
        DetectionError: there is no depth image, or no object in it, or its size is impossible.
    """
    sensor, image = rig.sensors[reference], observation.images.get(reference)
    if not (isinstance(image, DepthImage) and isinstance(sensor.noise, DepthNoise)):
        raise DetectionError(f"no depth image from {reference} yet")
    view = DepthView.of(subtract_mean_offset(sensor.noise, image.distance, image.amplitude), sensor.camera)
    _check_extent(view.points_r[view.measured], "everything in sight", LARGEST_SCENE_M, sensor.head)
    inside = region.select(view)
    _check_extent(view.points_r[inside], "the object", LARGEST_M, sensor.head)
    distance = np.where(inside, view.distance, np.nan).astype(np.float32)
    deviation = _median_deviation(sensor.noise, image, inside)
    return InitialDetection(distance, sensor.camera, vertices, view.distance, deviation)


def _median_deviation(noise: DepthNoise, image: DepthImage, inside: NDArray[np.bool_]) -> float:
    """Median standard deviation [m] of the distances at the pixels of a mask (height, width), of some of them."""
    rows, columns = (places[:: np.count_nonzero(inside) // MOST_POINTS + 1] for places in np.nonzero(inside))
    distance, amplitude = (values[rows, columns].astype(np.float64) for values in (image.distance, image.amplitude))
    deviation = noise.deviation(distance, amplitude, (rows, columns))
    return float(np.nanmedian(deviation)) if np.isfinite(deviation).any() else 0.0


def _check_extent(points: NDArray[np.float64], what: str, largest: float, sensor: str) -> None:
    """Checks the diagonal of the bounding box of points (k, 3) [m], without the outermost ones.

    Args:
        points: the points; none is in order, because then the region has more to say.
        what: their name in the message.
        largest: largest possible diagonal [m].
        sensor: name of the sensor that measured them.

    Raises:
        DetectionError: the diagonal is impossible.
    """
    if not len(points):
        return
    low, high = np.percentile(points[:: len(points) // MOST_POINTS + 1], EXTENT_PERCENT, axis=0)
    extent = float(np.linalg.norm(high - low))
    if not SMALLEST_M <= extent <= largest:
        wide = f"{extent * 1e3:.2g} mm" if extent < 1 else f"{extent:.0f} m"
        raise DetectionError(
            f"{what} would be {wide} wide: is the depth scale right? The device, depth_scale of imported images or "
            f"sensors.{sensor}.depth.scale determines it"
        )

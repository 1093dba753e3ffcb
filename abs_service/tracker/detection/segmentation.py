"""Segmentation of the object in a depth image by a region."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ColorImage, DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker import resolution
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.dropouts import fill_gaps
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.plausibility import MAX_M, MAX_POINTS, MAX_SCENE_M, check_extent
from abs_service.tracker.detection.regions.base import Region
from calib.noise.base import DepthNoise, Pixels, pixels_where, subtract_mean_offset
from calib.noise.fit.scatter import scatter
from calib.rig import Rig

#: Distances that scatter by this factor more than their noise model states contradict it. They are judged where they
#: differ from the object's by less than this share, because deviations change with the distance.
TOO_MUCH_SCATTER, AS_FAR = 1.5, 0.25

#: Distances that scatter by less or more than these factors of what their noise model says may have the wrong unit, if
#: in another one they scatter by at most that factor otherwise: structured light has 0.6 to 2.1 times its model's.
DOUBTFUL, FITTING, OTHER_SCALES = (0.25, 8.0), 2.5, (0.1, 10.0)


def detect_object(
    observation: Observation, rig: Rig, reference: str, region: Region, vertices: resolution.Vertices
) -> InitialDetection:
    """Segments the reference sensor's depth image by a region, for a mesh of about `vertices` vertices.

    "auto" is the default number, fewer if the object has fewer pixels.

    Raises:
        DetectionError: there is no depth image, or no object in it, or its size is impossible.
    """
    sensor, image = rig.sensors[reference], observation.images.get(reference)
    if not (isinstance(image, DepthImage) and isinstance(sensor.noise, DepthNoise)):
        raise DetectionError(f"no depth image from {reference} yet")
    distance = subtract_mean_offset(sensor.noise, image.distance, image.amplitude)
    pictures = [(rig.sensors[n].camera, i.rgb) for n, i in observation.images.items() if isinstance(i, ColorImage)]
    deviations = _deviations(sensor.noise, image)
    view = DepthView.of(fill_gaps(distance), sensor.camera, pictures, observation.t_host_ns, deviations)
    check_extent(view.points_r[view.measured], "everything in sight", MAX_SCENE_M, sensor.head)
    inside = region.select(view)
    check_extent(view.points_r[inside], "the object", MAX_M, sensor.head)
    own = np.where(inside, distance, np.nan).astype(np.float32)
    deviation = _median_deviation(sensor.noise, image, inside)
    count = resolution.vertices(int(np.isfinite(own).sum())) if vertices == "auto" else vertices
    scatters, fitting = _scatter(sensor.noise, image, distance, inside)
    scale = scatters if scatters > TOO_MUCH_SCATTER else 1.0
    return InitialDetection(own, sensor.camera, count, distance, scale * deviation, scale, fitting)


def _scatter(
    noise: DepthNoise, image: DepthImage, distance: NDArray[np.float32], inside: NDArray[np.bool_]
) -> tuple[float, float]:
    """Scatter of the distances of flat surfaces over that which the noise model states, and `fitting_scale`.

    The noise model weighs all measurements: with too small a deviation, many of a good mesh would seem to disagree.
    Both are 1 if nothing is known.

    Args:
        noise: the model.
        image: the depth image.
        distance: its distances without mean offset (height, width) [m].
        inside: the object's pixels (height, width).
    """
    own = distance[inside & np.isfinite(distance)]
    if not own.size:
        return 1.0, 1.0
    middle = float(np.median(own))
    as_far = np.abs(distance - middle) < AS_FAR * middle
    deviation = _median_deviation(noise, image, as_far)
    seen = scatter(np.where(as_far, distance, np.nan)) * middle**2
    if not (deviation and seen > 0):
        return 1.0, 1.0
    if DOUBTFUL[0] < seen / deviation < DOUBTFUL[1]:
        return seen / deviation, 1.0
    for scale in OTHER_SCALES:
        scaled = DepthImage(image.distance * np.float32(scale), image.amplitude)
        otherwise = _median_deviation(noise, scaled, as_far)
        # Time of flight errs about as much at any distance, so its scatter tells nothing of the unit.
        is_square = 1 / FITTING < otherwise / (scale**2 * deviation) < FITTING
        if is_square and 1 / FITTING < scale * seen / otherwise < FITTING:
            return seen / deviation, scale
    return seen / deviation, 1.0


def _deviations(noise: DepthNoise, image: DepthImage) -> NDArray[np.float32]:
    """Standard deviation (height, width) [m] of every distance by the noise model, NaN without return."""
    places = pixels_where(np.isfinite(image.distance))
    deviations = np.full(image.distance.shape, np.nan, np.float32)
    deviations[places] = _deviation_at(noise, image, places)
    return deviations


def _median_deviation(noise: DepthNoise, image: DepthImage, inside: NDArray[np.bool_]) -> float:
    """Median standard deviation [m] of the distances at the pixels of a mask (height, width), of some of them."""
    rows, columns = (places[:: np.count_nonzero(inside) // MAX_POINTS + 1] for places in np.nonzero(inside))
    deviation = _deviation_at(noise, image, (rows, columns))
    return float(np.nanmedian(deviation)) if np.isfinite(deviation).any() else 0.0


def _deviation_at(noise: DepthNoise, image: DepthImage, places: Pixels) -> NDArray[np.float64]:
    """Standard deviation (k,) [m] of the distances in rows and columns (k,)."""
    distance, amplitude = (values[places].astype(np.float64) for values in (image.distance, image.amplitude))
    return noise.deviation(distance, amplitude, places)

"""The object in the first frames: which pixels show it, and which colours its vertices have."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from abs_service.images import ColorImage, DepthImage
from abs_service.observation import Observation
from abs_service.tracker.regions.base import Region
from abs_service.tracker.sighting import Sighting, SightingError
from calib.camera import Camera
from calib.noise.base import without_offset
from calib.noise.color import GaussianColor
from calib.rig import Rig


def sight(observation: Observation, rig: Rig, reference: str, region: Region, vertices: int) -> Sighting:
    """The object that the region selects in the reference sensor's depth image, for a mesh of about `vertices`.

    Raises:
        SightingError: the reference sensor sees no object.
    """
    image = observation.images.get(reference)
    if not isinstance(image, DepthImage):
        raise SightingError(f"no depth image from {reference} yet")
    camera, noise = rig.sensors[reference].camera, rig.sensors[reference].noise
    if isinstance(noise, GaussianColor):
        raise SightingError(f"sensor {reference} delivers depth, but its noise model is one of colours")
    distance = without_offset(noise, image.distance, image.amplitude)
    inside = region.select(camera.unproject(distance), distance)
    return Sighting(np.where(inside, distance, np.nan).astype(np.float32), camera, vertices)


def vertex_colors(
    positions: NDArray[np.float64], images: Mapping[str, DepthImage | ColorImage], rig: Rig
) -> NDArray[np.float32]:
    """Mean colour (n, 3) of every vertex over the colour sensors that see it, NaN where none does."""
    total, count = np.zeros((len(positions), 3)), np.zeros((len(positions), 1))
    for name, image in images.items():
        if isinstance(image, ColorImage):
            color = _colors_in(image, rig.sensors[name].camera, positions)
            seen = np.isfinite(color).all(axis=1)
            total[seen] += color[seen]
            count[seen] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def _colors_in(image: ColorImage, camera: Camera, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    pixel = np.floor(camera.project(positions) + 0.5)
    inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=1)
    colors = np.full((len(positions), 3), np.nan)
    column, row = pixel[inside].astype(int).T
    colors[inside] = image.rgb[row, column]
    return colors

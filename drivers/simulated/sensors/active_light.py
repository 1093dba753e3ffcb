"""Active illumination: the returned intensity of a sensor's own light."""

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.scene.body import RayImage

#: Intensity returned by a white surface that faces the sensor at a distance of 1 m.
WHITE = 10_000.0


def returned(seen: RayImage) -> NDArray[np.float32]:
    """Returned intensity `WHITE` · infra-red reflectivity · cosine of incidence / distance², NaN for a miss.

    The light source is at the camera centre, so there are no shadows; surfaces are Lambertian.
    """
    return WHITE * seen.albedo[..., 3] * seen.cosine / seen.distance**2

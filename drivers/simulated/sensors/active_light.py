"""Light that a sensor sends out itself, and what of it comes back."""

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.scene.body import RayImage

#: What comes back from a white surface that faces the sensor at a distance of 1 m.
WHITE = 10_000.0


def returned(seen: RayImage) -> NDArray[np.float32]:
    """`WHITE` · infra-red reflectivity · cosine of incidence / distance², NaN where nothing is seen.

    The lamp is in the lens, so there are no shadows; a surface returns light as paper does, the same in all directions.
    """
    return WHITE * seen.albedo[..., 3] * seen.cosine / seen.distance**2

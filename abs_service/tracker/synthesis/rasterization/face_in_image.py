"""A face of a projected mesh as a triangle in the image."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projected
from calib.jit import kernel
from calib.warp.triangle import Triangle, triangle


@kernel
def face_in_image(
    seen: Projected, candidate: int, face: NDArray[np.int32]
) -> tuple[Triangle, np.float32, np.float32, np.float32]:
    """The triangle of a face (3,), and 1/z of its corners [1/m], NaN behind the camera."""
    a, b, c = face[0], face[1], face[2]
    place, inverse_z = seen.place[candidate], seen.inverse_z[candidate]
    at = triangle(place[a, 0], place[a, 1], place[b, 0], place[b, 1], place[c, 0], place[c, 1])
    return at, inverse_z[a], inverse_z[b], inverse_z[c]

"""Attributes of a surface at the centres of the pixels into which its vertices project."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import composed, kernel, prange
from calib.lenses.forward import brown_conrady_coefficients as coefficients
from calib.lenses.forward import distort, distort_fisheye, fisheye_coefficients


@kernel
def at_centers(
    vertices: NDArray[np.float32],
    pixel: NDArray[np.int32],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    stride: int,
    values: NDArray[np.float32],
    slopes: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Value + gradient · (centre of the pixel − projection of the vertex), eq. 10; the value itself in the border."""
    one, width, per_stride = np.float32(1), np.int32(stride), 1 / stride
    (fx, fy, cx, cy), own_lens = matrix, coefficients(lens)
    for k in prange(pixel.shape[0]):
        rights, downs = np.empty(pixel.shape[1], np.float32), np.empty(pixel.shape[1], np.float32)
        for v in range(pixel.shape[1]):
            right, down = np.float32(0), np.float32(0)
            if pixel[k, v] > 0:
                a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
                inverse = one / (pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3])
                x = (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]) * inverse
                y = (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]) * inverse
                bent_x, bent_y = distort(x, y, own_lens)
                column, row = fx * bent_x + cx, fy * bent_y + cy
                line = np.int32((pixel[k, v] + 0.5) * per_stride)  # divisions of integers take as long as all of this
                right = np.float32(pixel[k, v] - line * width) - one - column
                down = np.float32(line) - one - row
            rights[v], downs[v] = right, down
        for channel in range(values.shape[1]):
            own, slope, looks = values[:, channel], slopes[:, channel], result[k, :, channel]
            for v in range(np.uintp(looks.size)):
                looks[v] = own[v] + slope[v, 0] * rights[v] + slope[v, 1] * downs[v]


#: `at_centers` with the four coefficients of a fisheye lens.
at_centers_fisheye = composed(at_centers, distort=distort_fisheye, coefficients=fisheye_coefficients)

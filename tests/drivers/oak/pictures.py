"""A depth image of depthai, to be changed as a test needs it."""

import numpy as np

from drivers.oak.images.picture import Picture

MATRIX = np.array([[9.0, 0, 4], [0, 8, 3], [0, 0, 1]])
DEPTH = Picture(
    "RAW16", 8, 6, 16, np.arange(96, dtype=np.uint8), 5, 10**9, 7 * 10**8, 2e-3, 1.5, 40.0, 0, MATRIX, "PERSPECTIVE", ()
)

"""Missing returns of what is nearer than a depth sensor can measure: a surface that comes so near does not end there.

The line at which it leaves the range stays in place while the surface moves along itself. It differs from the end of an
object in the first image: nothing is nearer than it, its distance is the same all along it, and the surface comes
nearer towards it.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.detection.segments.neighbourhood import grown
from calib.camera import Camera

#: Cameras measure from 0.1 (RealSense D4xx, PMD), 0.4 (Kinect v1), 0.5 (Kinect v2, Azure Kinect) or 0.6 m (Astra) on.
MAX_M = 0.62
#: Depths of one line differ by at most this share: noise and steps of a near surface.
TOLERANCE = 0.01
#: Least number of its pixels, and share in those at the object's edge that are farther by the share `NEARLY` at most.
MIN_PIXELS, MIN_SHARE, NEARLY = 20, 0.7, 0.04
#: So many pixels from the line the surface is farther by `RISE` or more; that of a sheet across the view is not.
INSIDE_PX, RISE = 8, 0.015
#: Share by which returns, of as many pixels as a line has, are nearer if the range does not end there.
NEARER = 0.02


class NearestRange:
    """The shortest depth that a sensor measures, if the first image shows it.

    Args:
        camera: the depth camera.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._nearest: float | None = None
        self._begun = False

    def observe(
        self, distance: NDArray[np.float32], missing: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window
    ) -> NDArray[np.bool_]:
        """Missing returns (rows, columns) that border on what leaves the range; the first call learns.

        Args:
            distance: measured radial distances (rows, columns) [m], NaN without return.
            missing: areas without return there.
            expected: silhouette of the predicted mesh there.
            window: of the image; the first one has to be the whole image.
        """
        begins, self._begun = not self._begun, True
        if not (begins or self._nearest) or not missing.any():
            return np.zeros(missing.shape, np.bool_)
        depth = distance * self._camera.rays()[window][..., 2].astype(np.float32)
        edge = ~missing & grown(missing, 1)
        if begins:
            self._nearest = _nearest(depth, edge, missing, expected)
        elif np.count_nonzero(depth < (1 - NEARER) * (self._nearest or 0.0)) >= MIN_PIXELS:
            self._nearest = None
        if self._nearest is None:
            return np.zeros(missing.shape, np.bool_)
        return _beside(missing, edge & (depth < (1 + TOLERANCE) * self._nearest))


def _nearest(
    depth: NDArray[np.float32], edge: NDArray[np.bool_], missing: NDArray[np.bool_], expected: NDArray[np.bool_]
) -> float | None:
    """Depth [m] of the line at which the object leaves the range, None if there is none.

    Args:
        depth: measured z (height, width) [m], NaN without return.
        edge, missing: pixels beside missing returns, and these.
        expected: silhouette of the object.
    """
    around = grown(expected, INSIDE_PX)
    measured, at_edge = depth[np.isfinite(depth)], depth[edge & around]
    if len(measured) <= MIN_PIXELS:
        return None
    # Some strays may be nearer.
    nearest = float(np.partition(measured, MIN_PIXELS // 2)[MIN_PIXELS // 2])
    if nearest > MAX_M:
        return None
    line = edge & around & (depth < (1 + TOLERANCE) * nearest)
    length, nearly = np.count_nonzero(line), np.count_nonzero(at_edge < (1 + NEARLY) * nearest)
    if length < MIN_PIXELS or length < MIN_SHARE * nearly:
        return None
    away = cv2.distanceTransform((~missing).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    inside = depth[(away > INSIDE_PX) & (away < INSIDE_PX + 2) & expected & grown(line, INSIDE_PX + 3)]
    return nearest if inside.size and np.median(inside) > (1 + RISE) * nearest else None


def _beside(missing: NDArray[np.bool_], line: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Missing returns (rows, columns) whose nearest return is on a line."""
    if not line.any():
        return np.zeros(missing.shape, np.bool_)
    found = cv2.distanceTransformWithLabels(
        missing.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = np.asarray(found[1], np.int32)
    on_line = np.zeros(int(labels.max()) + 1, np.bool_)
    on_line[labels[line]] = True
    return missing & on_line[labels]

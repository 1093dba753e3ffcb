"""What the pixels of a depth image show where the object is expected: the object, an occluder, nothing, free space.

A vertex may miss its measurement for three reasons, which say different things about the deformation. Something stands
before it, or the sensor got no return where the object should be: then nothing is known. Or the sensor looks past
the place where the vertex should be: then the vertex is not there, and the nearest part of the object says how far off
it is.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.surfaces import connected_surfaces

#: Measurements this near to the predicted distance show the object; it may have moved by as much since [m].
AGREEMENT_M = 0.03

#: Neighbouring pixels whose distances differ by more show different surfaces [m].
LARGEST_STEP_M = 0.04

#: A connected surface is the object if at least this share of what it has on the expected place agrees …
LEAST_SHARE = 0.3
#: … and so many pixels do.
LEAST_PIXELS = 10

#: Missing returns deeper inside the expected outline are holes in the measurement, with what is missing around them up
#: to twice as far away; elsewhere, the outline itself may have moved [m].
RIM_M = 0.015


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Masks (height, width) of one depth image.

    Attributes:
        object: shows the object.
        foreground: shows something before the object.
        hole: no return where the object should be.
        free_m: distance to the nearest pixel of the object, across the line of sight [m], where the sensor looks past
            the object; 0 elsewhere.
    """

    object: NDArray[np.bool_]
    foreground: NDArray[np.bool_]
    hole: NDArray[np.bool_]
    free_m: NDArray[np.float32]


def classify(distance: NDArray[np.float32], predicted: NDArray[np.float32], focal: float) -> Visibility:
    """Classifies the pixels of one depth image by connected surfaces.

    If no surface agrees with the prediction, it is the prediction that is wrong, and nothing is classified.

    Args:
        distance: measured radial distances (height, width) [m], NaN without return.
        predicted: radial distances of the predicted mesh [m], infinite beside it.
        focal: focal length of the camera [px].
    """
    expected = np.isfinite(predicted)
    labels, count = connected_surfaces(distance, LARGEST_STEP_M)
    with np.errstate(invalid="ignore"):
        agrees = expected & (np.abs(distance - predicted) < AGREEMENT_M)
    inside = np.bincount(labels[expected], minlength=count)
    agreeing = np.bincount(labels[agrees], minlength=count)
    is_object = (agreeing >= LEAST_PIXELS) & (agreeing >= LEAST_SHARE * inside)
    is_object[0] = False
    nothing = np.zeros(distance.shape, np.bool_)
    if not is_object.any():
        return Visibility(nothing, nothing, nothing, np.zeros(distance.shape, np.float32))
    shown = is_object[labels]
    near = _extended(np.where(expected, predicted, np.nan))[0]
    with np.errstate(invalid="ignore"):
        before = ~shown & (distance < near - AGREEMENT_M)
        behind = ~shown & (distance > near + AGREEMENT_M)
    foreground = before & (cv2.dilate(((labels > 0) & before).astype(np.uint8), np.ones((3, 3))) > 0)
    with np.errstate(over="ignore"):  # where the object fills the image, its outline is infinitely far away
        missing = ~np.isfinite(distance)
        hole = missing & (_depth_inside(expected) * near / focal > RIM_M)
        if hole.any():
            hole |= missing & (_depth_inside(~hole) * near / focal < 2 * RIM_M)
    away, steps = _extended(np.where(shown, near, np.nan))
    return Visibility(shown, foreground, hole, np.where(behind, steps * away / focal, 0).astype(np.float32))


def _extended(values: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """An image without its NaNs, each replaced by the nearest value, and how far away that is [px]."""
    known = np.isfinite(values)
    steps, labels = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    places = np.asarray(labels, np.int32)
    table = np.zeros(int(places.max()) + 1, np.float32)
    table[places[known]] = values[known]
    return table[places], np.asarray(steps, np.float32)


def _depth_inside(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance of every pixel of a mask from the mask's edge [px]."""
    return np.asarray(cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)

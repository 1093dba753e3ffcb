"""Classification of the pixels of a depth image near the prediction: object, occluder, hole or free space.

A vertex may have no measurement for three reasons. An occluder or a hole in the measurement gives no information about
the deformation. Free space does: the vertex cannot be there, and the distance to the nearest pixel of the object is its
error. A missing return is free space where the background gives no return, else a hole.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.segments.depth_segments import Surfaces, connected_surfaces
from abs_service.tracker.detection.segments.neighbourhood import grown
from abs_service.tracker.terms.depth.classification.background import MAX_DEPTH_M
from calib.jit import kernel

#: Measurements this near to the predicted distance show the object; it may have moved by as much since [m].
AGREEMENT_M = 0.03

#: Neighbouring pixels whose distances differ by more show different surfaces [m].
MAX_STEP_M = 0.04

#: A connected surface is the object if at least this share of what it has on the expected place agrees …
MIN_SHARE = 0.3
#: … and at least this number of pixels does.
MIN_PIXELS = 10

#: Missing returns deeper inside the expected outline are holes in the measurement, with what is missing around them up
#: to twice as far away; elsewhere, the outline itself may have moved [m].
RIM_M = 0.015


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Masks (height, width) of one depth image.

    Attributes:
        object: shows the object.
        foreground: shows something before the object.
        hole: no return over an area where the object should be.
        dropout: no return of single pixels, see `dropouts`.
        beyond: no return beyond the field of view, a part of the holes.
        free_m: distance to the nearest pixel of the object, across the line of sight [m], where the sensor looks past
            the object to a background, measured or without return; 0 elsewhere.
        unsettled: where the object may end, or the field of view, see `FixedEdges`.
        lost: no return in an area in which the background has had some, see `Background`.
    """

    object: NDArray[np.bool_]
    foreground: NDArray[np.bool_]
    hole: NDArray[np.bool_]
    dropout: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    free_m: NDArray[np.float32]
    unsettled: NDArray[np.bool_]
    lost: NDArray[np.bool_]


class Compared(NamedTuple):
    """Masks (height, width) of the pixels of an image by their distance from the predicted mesh.

    Attributes:
        shown: on the object.
        before: before it.
        solid: of these, on a connected surface.
        behind: behind it.
        missing: without return.
    """

    shown: NDArray[np.bool_]
    before: NDArray[np.bool_]
    solid: NDArray[np.bool_]
    behind: NDArray[np.bool_]
    missing: NDArray[np.bool_]


def surfaces_of(distance: NDArray[np.floating], maximum_step: float = MAX_STEP_M) -> Surfaces:
    """Surfaces of radial distances (height, width) [m], NaN without return, separated at larger steps [m]."""
    return connected_surfaces(np.ascontiguousarray(distance, np.float32), maximum_step)


def classify(
    surfaces: Surfaces,
    predicted: NDArray[np.float32],
    focal: float,
    empty: NDArray[np.bool_] | np.bool_ = np.False_,
    dropout: NDArray[np.bool_] | np.bool_ = np.False_,
    beyond: NDArray[np.bool_] | np.bool_ = np.False_,
    agreement: float = AGREEMENT_M,
) -> Visibility:
    """Classifies the pixels of one depth image by connected surfaces.

    If no surface agrees with the prediction, it is the prediction that is wrong, and nothing is classified.

    Args:
        surfaces: of the measured distances (height, width), see `surfaces_of`.
        predicted: radial distances of the predicted mesh [m], infinite beside it.
        focal: focal length of the camera [px].
        empty: missing returns (height, width) that show the background, see `Background`.
        dropout: missing returns of single pixels, see `dropouts`.
        beyond: missing returns beyond the field of view, see `BeyondView`; they count as a hole.
        agreement: distance from the prediction up to which a measurement shows the object [m].
    """
    distance, labels, predicted = surfaces.distance, surfaces.labels, np.ascontiguousarray(predicted, np.float32)
    is_object = np.zeros(surfaces.count, np.bool_)
    _recognize(distance, predicted, labels, agreement, is_object)
    nothing = np.zeros(distance.shape, np.bool_)
    if not is_object.any():
        free_m = np.zeros(distance.shape, np.float32)
        return Visibility(nothing, nothing, nothing, nothing, nothing | beyond, free_m, nothing, nothing)
    near = _extended(predicted)
    pixels = Compared(*(np.empty(distance.shape, np.bool_) for _ in Compared._fields))
    _compare(distance, near, labels, is_object, agreement, pixels)
    shown, before, solid, behind, missing = pixels
    foreground = before & grown(solid, 1) if solid.any() else nothing
    hole, past, single = nothing, nothing, missing & dropout & ~beyond
    if missing.any():
        hole, past = _holes(missing & ~(single | beyond), np.isfinite(predicted), near, focal, empty)
        hole |= beyond
    free_m = _depth_inside(~shown)
    keep_free(behind | past, near, np.float32(focal), free_m)
    return Visibility(shown, foreground, hole, single, nothing | beyond, free_m, nothing, nothing)


@kernel
def _recognize(
    distance: NDArray[np.float32],
    predicted: NDArray[np.float32],
    labels: NDArray[np.int32],
    agreement: float,
    is_object: NDArray[np.bool_],
) -> None:
    """True for each connected surface (count,) that is the object; label 0 is no surface."""
    inside, agreeing = np.zeros(is_object.size, np.int64), np.zeros(is_object.size, np.int64)
    for row in range(distance.shape[0]):
        for column in range(distance.shape[1]):
            expected, label = predicted[row, column], labels[row, column]
            if np.isfinite(expected):
                inside[label] += 1
                agreeing[label] += 1 if abs(distance[row, column] - expected) < agreement else 0
    for label in range(1, is_object.size):
        is_object[label] = agreeing[label] >= max(MIN_PIXELS, MIN_SHARE * inside[label])


@kernel
def _compare(
    distance: NDArray[np.float32],
    near: NDArray[np.float32],
    labels: NDArray[np.int32],
    is_object: NDArray[np.bool_],
    agreement: float,
    pixels: Compared,
) -> None:
    """Writes the masks, from distances, those of the nearest place on the object, and surfaces that are the object."""
    for row in range(distance.shape[0]):
        for column in range(distance.shape[1]):
            label, beyond = labels[row, column], distance[row, column] - near[row, column]
            is_shown = is_object[label]
            is_before = not is_shown and beyond < -agreement
            pixels.shown[row, column], pixels.before[row, column] = is_shown, is_before
            pixels.solid[row, column] = is_before and label > 0
            pixels.behind[row, column] = not is_shown and beyond > agreement
            pixels.missing[row, column] = not np.isfinite(distance[row, column])


@kernel
def keep_free(free: NDArray[np.bool_], near: NDArray[np.float32], focal: np.float32, away: NDArray[np.float32]) -> None:
    """Distances from the object [px] become metres at the distance of its nearest place [m], 0 outside free space."""
    for row in range(away.shape[0]):
        for column in range(away.shape[1]):
            at = row, column
            away[at] = away[at] * near[at] / focal if free[at] else np.float32(0)


def _holes(
    missing: NDArray[np.bool_],
    expected: NDArray[np.bool_],
    near: NDArray[np.float32],
    focal: float,
    empty: NDArray[np.bool_] | np.bool_,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Missing returns that are holes in the measurement, and those that show the background.

    Args:
        missing: pixels without return (height, width).
        expected: pixels inside the expected outline.
        near: distances of the nearest place on the object [m].
        focal: focal length of the camera [px].
        empty: missing returns that show the background unless they are too deep inside the expected outline.
    """
    inside = missing & expected
    if not inside.any():
        return inside, empty & ~inside
    metres = near / focal  # the width of a pixel on the object
    with np.errstate(over="ignore"):  # where the object fills the image, its outline is infinitely far away
        depth = _depth_inside(expected) * metres
    hole = inside & (depth > np.where(empty, np.float32(MAX_DEPTH_M), np.float32(RIM_M)))
    if hole.any():
        hole |= missing & ~empty & (_depth_inside(~hole) * metres < 2 * RIM_M)
    return hole, empty & ~hole


def _extended(predicted: NDArray[np.float32]) -> NDArray[np.float32]:
    """Distances [m] of the predicted mesh, beside it those of its nearest pixel, found in an image of half the size."""
    coarse = np.full([-(-size // 2) for size in predicted.shape], np.float32(np.inf))
    _halve(predicted, coarse)
    labels = cv2.distanceTransformWithLabels(
        (~np.isfinite(coarse)).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    values = np.empty(predicted.shape, np.float32)
    _spread(predicted, coarse, np.asarray(labels, np.int32), values)
    return values


@kernel
def _halve(image: NDArray[np.float32], coarse: NDArray[np.float32]) -> None:
    """Least value of every square of four pixels, into infinities of half the size, rounded up."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            coarse[row // 2, column // 2] = min(coarse[row // 2, column // 2], image[row, column])


@kernel
def _spread(
    predicted: NDArray[np.float32],
    coarse: NDArray[np.float32],
    labels: NDArray[np.int32],
    values: NDArray[np.float32],
) -> None:
    """Predicted values, beside them those of the coarse pixel with the same label; NaN if there is none."""
    table = np.full(labels.size + 1, np.float32(np.nan))
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            if np.isfinite(coarse[row, column]):
                table[labels[row, column]] = coarse[row, column]
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            own = predicted[row, column]
            values[row, column] = own if np.isfinite(own) else table[labels[row // 2, column // 2]]


def _depth_inside(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance of every pixel of a mask from the mask's edge [px]."""
    return np.asarray(cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)

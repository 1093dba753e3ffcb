"""Keypoints of an image, and which of them match known ones.

SIFT: D. Lowe, Distinctive image features from scale-invariant keypoints. International Journal of Computer Vision 60,
2004.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

#: Longest side of the image in which keypoints are looked for [px]; finer ones are recognised no better. And how many.
SIDE_PX, MAX_KEYPOINTS = 320, 500

#: The descriptor of a keypoint is this much nearer to that of its match than to any other one's (D. Lowe).
RATIO = 0.8

#: An 8-bit image (height, width) of one channel, or values (height, width) of any range.
Grey = NDArray[np.uint8] | NDArray[np.float32]


def detect(grey: Grey, places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Places (k, 2) [px] and descriptors (k, 128) of the keypoints of an image around a mesh at pixels (n, 2).

    In a window three times as large as the mesh, in the middle of which it is.
    """
    (left, top), (right, bottom) = _window(places, grey.shape)
    image = _as_levels(grey[top:bottom, left:right])
    scale = min(1.0, SIDE_PX / max(image.shape))
    size = [max(round(scale * side), 1) for side in image.shape[::-1]]
    keypoints, descriptors = cv2.SIFT.create(MAX_KEYPOINTS).detectAndCompute(
        cv2.resize(image, size, interpolation=cv2.INTER_AREA), None
    )
    if not keypoints:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    scales = np.array(size) / image.shape[::-1]
    found = (np.array([keypoint.pt for keypoint in keypoints]) + 0.5) / scales - 0.5
    return found + np.array([left, top]), np.asarray(descriptors, np.float32)


def match(known: NDArray[np.float32], descriptors: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of known descriptors (m, 128) and of those (k, 128) that they match, one to one.

    Of a pattern that repeats itself, many match the same few; the nearest ones count.
    """
    if len(descriptors) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(known, descriptors, 2)
    distinct = [one for one, other in pairs if one.distance < RATIO * other.distance]
    distinct.sort(key=lambda one: one.distance, reverse=True)
    nearest = {one.trainIdx: one.queryIdx for one in distinct}
    return np.array(list(nearest.values()), np.intp), np.array(list(nearest), np.intp)


def _window(places: NDArray[np.float64], shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and end (2,) of the columns and rows of a window; the whole image if the mesh is not in it."""
    end = np.array(shape[1::-1])
    inside = places[((places >= 0) & (places < end)).all(axis=1)]
    if not len(inside):
        return np.zeros(2, np.intp), end
    low, high = inside.min(axis=0), inside.max(axis=0)
    side = (high - low).max()
    return np.maximum(low - side, 0).astype(np.intp), np.minimum(high + side + 2, end).astype(np.intp)


def _as_levels(grey: Grey) -> NDArray[np.uint8]:
    """Values as levels of 8 bits: the largest hundredth of them, and unknown ones, are at the ends of the range."""
    if grey.dtype == np.uint8:
        return np.asarray(grey, np.uint8)
    values = np.nan_to_num(np.asarray(grey, np.float32), posinf=0.0, neginf=0.0)
    return np.clip(values * (255 / max(float(np.quantile(values, 0.99)), 1e-9)), 0, 255).astype(np.uint8)

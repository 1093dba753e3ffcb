"""Outlines of pixels whose exact course is known."""

import cv2
import numpy as np

from abs_service.tracker.terms.depth.outline.rim import Look, look_up

HEIGHT, WIDTH = 240, 320


def inside_of(corners: np.ndarray) -> np.ndarray:
    """Distances (HEIGHT, WIDTH) of the pixels inside a convex polygon (k, 2), clockwise, from its outline [px]."""
    row, column = np.indices((HEIGHT, WIDTH))
    mask = np.ones((HEIGHT, WIDTH), np.bool_)
    for (x, y), (x_next, y_next) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        mask &= (x_next - x) * (row - y) - (y_next - y) * (column - x) > 0
    inside, outside = (
        cv2.distanceTransform(one.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5) for one in (mask, ~mask)
    )
    return (inside - outside + ~mask - 0.5).astype(np.float32)


def reading(image: np.ndarray) -> Look:
    """Reads such distances between pixels."""

    def look(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, gradients = np.empty(len(places)), np.empty((len(places), 2))
        look_up(image, places, values, gradients)
        return values, gradients

    return look


def turned(points: np.ndarray, angle: float, by: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Points (k, 2) turned about the middle of the image [rad] and moved [px]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    return (points - middle) @ np.array([[cosine, sine], [-sine, cosine]]) + middle + by


def rectangle(width: float, height: float) -> np.ndarray:
    """Corners (4, 2) of a rectangle in the middle of the image [px]."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.array([WIDTH / 2, HEIGHT / 2]) + signs * np.array([width, height]) / 2


def edges(corners: np.ndarray, every: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 2) along the sides of a polygon, clockwise [px], and unit directions out of it (k, 2)."""
    places, directions = [], []
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = other - one
        share = np.arange(every / 2, np.linalg.norm(side), every) / np.linalg.norm(side)
        places.append(one + share[:, None] * side)
        directions.append(np.tile(side[::-1] * (1, -1) / np.linalg.norm(side), (len(share), 1)))
    return np.concatenate(places), np.concatenate(directions)

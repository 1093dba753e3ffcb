"""Principal axes of points, and the box around the points along them."""

import cv2
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def principal_axes(points: Points) -> tuple[Points, Points]:
    """Centre (3,) and right-handed axes (3, 3), as columns, the longest first, of a box around points (k, 3).

    The third axis is that of least variance. The others are those of the rectangle of least area around the points as
    seen along it, which does not turn when a part of a rectangle is hidden, as axes of largest variance do.
    """
    mean = points.mean(axis=0)
    by_variance = np.linalg.eigh((points - mean).T @ (points - mean))[1][:, ::-1]
    flat = ((points - mean) @ by_variance[:, :2]).astype(np.float32)
    one, two, three = cv2.boxPoints(cv2.minAreaRect(flat)).astype(np.float64)[:3]
    long = by_variance[:, :2] @ max(two - one, three - two, key=np.linalg.norm)
    long /= np.linalg.norm(long)
    axes = np.column_stack([long, np.cross(by_variance[:, 2], long), by_variance[:, 2]])
    along = (points - mean) @ axes
    return mean + axes @ (along.min(axis=0) + along.max(axis=0)) / 2, axes


def extents(points: Points) -> str:
    """Lengths of the box around points (k, 3) along their principal axes, for messages."""
    along = points @ principal_axes(points)[1]
    low, high = np.percentile(along, (0.5, 99.5), axis=0)
    return " × ".join(f"{length:.3f} m" for length in high - low)

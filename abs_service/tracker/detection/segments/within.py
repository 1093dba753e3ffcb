"""Mask images and polygons, and regions that are limited to them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le, MinLen
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from drivers.image_folder import image_file
from drivers.image_folder.listing import ImageFolderError

#: Pixels (height, width) of the object in a view.
Select = Callable[[DepthView], NDArray[np.bool_]]


#: Column or row of a corner [px], in the largest image of all; the corners (column, row) of a polygon.
Place = Annotated[int, Ge(0), Le(16383)]
Polygon = Annotated[tuple[tuple[Place, Place], ...], MinLen(3)]


@dataclass(frozen=True, eq=False)
class Restricted:
    """A region made of two steps: the view is limited, then the object's pixels are selected from the rest."""

    limit: Callable[[DepthView], DepthView]
    selection: Select

    def select(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the object; DetectionError if there is none."""
        return self.selection(self.limit(view))


def restricted(selection: Select, within: Path | None, polygon: Polygon | None) -> Restricted:
    """The region of a selection that ignores all pixels outside a mask image and a polygon.

    Args:
        selection: selects the object's pixels in a limited view.
        within: the mask image, see `load_mask`; None for the entire view.
        polygon: corners of the polygon; None for the entire view.

    Raises:
        DetectionError: the file is missing or no image.
    """
    mask = None if within is None else load_mask(within, "within")

    def limit(view: DepthView) -> DepthView:
        masked = view if mask is None else limited(view, mask)
        return masked if polygon is None else limited(masked, filled(polygon, view.distance.shape))

    return Restricted(limit, selection)


def filled(polygon: Polygon, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Pixels (height, width) of a polygon, its edges included, in an image of that shape."""
    inside = np.zeros(shape, np.uint8)
    cv2.fillPoly(inside, [np.array(polygon, np.int32)], 1)
    return inside.view(np.bool_)


def load_mask(file: Path, key: str) -> NDArray[np.bool_]:
    """Pixels (height, width) where an image's alpha channel, or without one its brightness, is not zero.

    Raises:
        DetectionError: the file is missing or no image.
    """
    try:
        image = image_file.read(file)
    except ImageFolderError as error:
        reason = str(error).removeprefix(f"{file}: ")
        raise DetectionError(f"{key} = {str(file)!r}: {reason}") from error
    if image.ndim == 3:
        image = image[..., 3] if image.shape[2] == 4 else image.max(axis=2)
    return np.asarray(image > 0)

"""Input of a region: one depth image, its points, the camera that measured it, and the colours of its pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError
from calib.camera import Camera
from calib.warp.errors import WarpError
from calib.warp.pictures import PictureLookup

#: Largest difference in distance between neighbouring pixels of one surface [m]; "auto": see `DepthView.step`.
Step = Literal["auto"] | Annotated[float, Gt(0)]

#: Smallest step between two surfaces where the noise does not matter [m], and largest step that is noise, in standard
#: deviations of the distances. At 2.8 m, a structured light camera splits a person at 0.04 m, but not at 5 deviations.
MIN_STEP_M, NOISE_STEPS = 0.04, 5.0

#: Largest step within one surface, in widths of a pixel on the object: that of a surface that is slanted by 60° across
#: the three pixels that are compared. At 2 m, pixels of 22 mm split a person into pieces at 0.04 m.
SLANT_STEPS = 3.5

#: A colour image (height, width, 3), red, green, blue in 0…255, and the camera that took it.
Picture = tuple[Camera, NDArray[np.uint8]]


class PixelColors:
    """Colours of a depth image's pixels, resampled when they are first asked for: most regions need none.

    Args:
        distance: radial distances (height, width) [m], NaN without return.
        camera: the camera that measured them.
        pictures: colour images of the same moment.
    """

    def __init__(self, distance: NDArray[np.float32], camera: Camera, pictures: Sequence[Picture]):
        self._distance, self._camera, self._pictures = distance, camera, pictures

    @cached_property
    def rgb(self) -> NDArray[np.float32]:
        """Red, green, blue (height, width, 3) in 0…255 by the camera that sees most pixels; NaN where it sees none."""
        unseen = np.full((*self._distance.shape, 3), np.nan, np.float32)
        seen = [self._resampled(*picture) for picture in self._pictures]
        return max(seen, key=lambda rgb: int(np.isfinite(rgb).sum()), default=unseen)

    def _resampled(self, camera: Camera, picture: NDArray[np.uint8]) -> NDArray[np.float32]:
        try:
            return PictureLookup(self._camera, camera).look(self._distance).blended(picture)
        except WarpError:  # the camera looks elsewhere, or there is no return
            return np.full((*self._distance.shape, 3), np.nan, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class DepthView:
    """One depth image in SI units.

    Attributes:
        points_r: rig coordinates of every pixel (height, width, 3) [m], NaN without return.
        distance: radial distances (height, width) [m], NaN without return.
        camera: the camera that measured them.
        colors: of the pixels.
        t_ns: time of the image, CLOCK_MONOTONIC [ns].
        deviation: standard deviation of the distances (height, width) [m], NaN or zero where unknown.
    """

    points_r: NDArray[np.float64]
    distance: NDArray[np.float32]
    camera: Camera
    colors: PixelColors
    t_ns: int
    deviation: NDArray[np.float32] | float = 0.0

    @classmethod
    def of(
        cls,
        distance: NDArray[np.float32],
        camera: Camera,
        pictures: Sequence[Picture] = (),
        t_ns: int = 0,
        deviation: NDArray[np.float32] | float = 0.0,
    ) -> "DepthView":
        """The view of radial distances (height, width) [m], NaN without return; other arguments as in the class."""
        colors = PixelColors(distance, camera, pictures)
        return cls(camera.unproject(distance), distance, camera, colors, t_ns, deviation)

    def step(self, maximum: Step) -> NDArray[np.float32] | float:
        """Largest difference in distance [m] between neighbours of one surface, (height, width) if it is "auto"."""
        if maximum != "auto":
            return maximum
        noise = np.fmax(np.float32(MIN_STEP_M), NOISE_STEPS * np.float32(self.deviation))
        pixel = self.distance / np.float32(min(self.camera.fx, self.camera.fy))
        return np.asarray(np.fmax(noise, np.float32(SLANT_STEPS) * pixel))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Pixels (height, width) with a return."""
        return np.isfinite(self.distance)


def limited(view: DepthView, within: NDArray[np.bool_]) -> DepthView:
    """The same view without the returns outside a mask (height, width).

    Raises:
        DetectionError: the mask has another size than the image.
    """
    if within.shape != view.distance.shape:
        raise DetectionError(f"the mask is {within.shape[::-1]} pixels, the depth image {view.distance.shape[::-1]}")
    points_r = np.where(within[..., None], view.points_r, np.nan)
    distance = np.where(within, view.distance, np.nan).astype(np.float32, copy=False)
    return replace(view, points_r=points_r, distance=distance)


def at_points(image: NDArray[np.floating], camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k,) of an image (height, width) at the pixels that show points (k, 3) [m]; NaN outside the image."""
    place = np.floor(camera.project(points) + 0.5)
    with np.errstate(invalid="ignore"):
        inside = camera.in_field(points) & np.all((place >= 0) & (place < (camera.width, camera.height)), axis=1)
    values = np.full(len(points), np.nan)
    column, row = place[inside].astype(np.intp).T
    values[inside] = image[row, column]
    return values

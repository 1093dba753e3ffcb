"""A depth image as another camera would have it (section 3.2): the surface between its pixels, by a z-buffer."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.warp import bending, errors, raster, shading
from calib.warp.points import Geometry, Points, bands

Value = TypeVar("Value", bound=np.generic)

#: Neighbours whose distances differ by more belong to different surfaces; nothing is rendered between them [m].
LARGEST_STEP_M = 0.04

#: What is nearer may reach so far from the centre of its outermost pixel towards the next pixel's centre [pixels].
_REACH = 0.99


class Each(Protocol):
    """What applies a function to all parts of an image: the built-in `map`, or `map` of a pool of threads."""

    def __call__(
        self, function: Callable[[tuple[int, int]], None], parts: Iterable[tuple[int, int]], /
    ) -> Iterable[None]:
        """The results in order; the parts may be worked on at the same time."""
        ...


class MeshWarp:
    """Warps what a depth sensor measured into any other view; distances there are radial, from the view's own centre.

    Neighbouring pixels span a surface, which is exact where the scene is flat: a pixel of the view is not moved by half
    a pixel of the source, whatever the slope. It ends at the outermost pixels' centres, and what lies behind a rim is
    unknown as near to it as a pixel of the source is wide.
    """

    def __init__(
        self,
        source: Camera,
        target: Camera,
        largest_step_m: float = LARGEST_STEP_M,
        each: Each = map,
        parts: int = 1,
    ):
        """Prepares all that does not depend on images.

        Args:
            source: the depth sensor.
            target: the view: a pinhole, or any other camera.
            largest_step_m: neighbours whose distances differ by more belong to different surfaces [m].
            each: what works on the parts; kernels hold no interpreter lock.
            parts: bands of rows that may be worked on at the same time.

        Raises:
            LensError: one of the lenses has no inverse on the image.
        """
        self.geometry = Geometry(source, target)
        self.largest_step_m = largest_step_m
        self._ray_length = target.lookup.ray_length.astype(np.float32)
        reach = _REACH * max(target.fx / source.fx, target.fy / source.fy) / source.lookup.ray_length
        self._reach = reach.astype(np.float32)
        self._each = each
        self._bands = bands(target.height, parts)

    def warp(self, distance: NDArray[np.floating]) -> "Warped":
        """The source's radial distances (h, w) [m], NaN without return, in the view.

        Raises:
            WarpError: there is nothing to be seen in the view, or units are wrong; says why.
        """
        errors.check(distance, self.geometry.source, self.geometry.target)
        points = self.geometry.see(distance)
        nearness = np.zeros(self._ray_length.shape, np.float32)
        face = np.full(self._ray_length.shape, -1, np.int32)
        warped = np.empty(self._ray_length.shape, np.float32)

        measured = (points.place, points.inverse_z, points.distance)

        def work(rows: tuple[int, int]) -> None:
            raster.cover(*measured, self.largest_step_m, *rows, nearness, face)
            shading.measure(face, nearness, self._ray_length, *rows, warped)

        for _ in self._each(work, self._bands):
            pass
        raster.fray(*measured, self.largest_step_m, self._reach, nearness, face, warped)
        if not (face >= 0).any():
            raise errors.nothing_seen(distance, points.inverse_z, self.geometry.target)
        return Warped(warped, points, self.geometry, self.largest_step_m, face, nearness)


@dataclass(frozen=True, slots=True, eq=False)
class Warped:
    """A depth image in another view, and what else belongs to its measurements.

    Attributes:
        distance: radial distances from the view's centre (height, width) [m], NaN where nothing is known.
        points: the source's points in the view.
        geometry: of the two cameras.
        largest_step_m: as in `MeshWarp`.
        face: number of the face that a pixel shows (`calib.warp.raster`), −1 if none.
        nearness: its 1/z there [1/m].
    """

    distance: NDArray[np.float32]
    points: Points
    geometry: Geometry
    largest_step_m: float
    face: NDArray[np.int32]
    nearness: NDArray[np.float32]

    def hidden(self) -> NDArray[np.bool_]:
        """What the view sees (height, width) but something nearer hides from the source: nothing is known there."""
        torn = np.zeros(self.face.shape, np.bool_)
        points = self.points
        raster.tear(points.place, points.inverse_z, points.distance, self.largest_step_m, torn)
        return torn & (self.face < 0)

    def index(self) -> NDArray[np.int32]:
        """The pixel of the source, flattened, that is nearest to a pixel of the view (height, width), −1 if none is."""
        result = np.empty(self.face.shape, np.int32)
        shading.nearest(*self._faces(), result)
        return result

    def nearest(self, image: NDArray[Value], missing: float = np.nan) -> NDArray[Value]:
        """An image (h, w, …) of the source in the view, no pixel mixed with another: confidences, colours, labels."""
        index = self.index()
        flat = image.reshape(-1, *image.shape[2:])
        result = flat[np.maximum(index, 0)]
        result[index < 0] = missing
        return result

    def blended(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """An image (h, w) of the source in the view, linear between its pixels: amplitudes; NaN where none is known."""
        result = np.empty(self.face.shape, np.float32)
        shading.blend(*self._faces(), np.ascontiguousarray(image, np.float32).ravel(), result)
        return result

    def deviation(self, sigma: NDArray[np.floating]) -> NDArray[np.float32]:
        """Deviation of the warped distances (height, width) [m], for deviations of the source's (h, w) [m].

        It is their noise, carried along, and how far the surface leaves the faces between its points. Neighbours that
        come from the same measurements err alike.
        """
        given = np.ascontiguousarray(np.broadcast_to(sigma, self.points.distance.shape), np.float32)
        bend, result = np.empty_like(given), np.empty(self.face.shape, np.float32)
        bending.bending(self.points.distance, given, self.largest_step_m, bend)
        geometry = self.geometry
        view_rays = geometry.target.lookup.rays.astype(np.float32)
        flat = (self.points.distance.ravel(), geometry.rays.reshape(-1, 3), geometry.shift, view_rays)
        shading.deviate(*self._faces(), *flat, given.ravel(), bend.ravel(), result)
        return result

    def _faces(self) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        return self.face, self.nearness, self.points.place, self.points.inverse_z

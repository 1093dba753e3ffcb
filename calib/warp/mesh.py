"""Mesh warping of a depth image into another view (section 3.2): triangles between pixels, with a z-buffer."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.warp import bending, errors, raster, shading
from calib.warp.points import Geometry, Points, bands

Value = TypeVar("Value", bound=np.generic)

#: Largest difference of neighbouring distances on one surface [m]; larger ones separate surfaces.
MAX_STEP_M = 0.04

#: Extent of a foreground surface beyond its outermost pixel centre, as a fraction of the next pixel.
_REACH = 0.99


class ParallelMap(Protocol):
    """Applies a function to all parts of an image: the built-in `map`, or `map` of a thread pool."""

    def __call__(
        self, function: Callable[[tuple[int, int]], None], parts: Iterable[tuple[int, int]], /
    ) -> Iterable[None]:
        """Results in order; parts may be processed concurrently."""
        ...


class MeshWarp:
    """Warps a depth image into any other view; distances there are radial, from the view's own centre.

    Neighbouring pixels span triangles, which are exact where the scene is planar, whatever the slope. The surface ends
    at the centres of its outermost pixels; the background within one source pixel of a depth edge is unknown.
    """

    def __init__(
        self,
        source: Camera,
        target: Camera,
        maximum_step_m: float = MAX_STEP_M,
        each: ParallelMap = map,
        parts: int = 1,
    ):
        """Precomputes everything that does not depend on images.

        Args:
            source: the depth sensor.
            target: the view: a pinhole, or any other camera.
            maximum_step_m: largest difference of neighbouring distances on one surface [m].
            each: applies a function to the parts; kernels release the interpreter lock.
            parts: number of bands of rows that may be processed concurrently.

        Raises:
            LensError: one of the lenses has no inverse on the image.
        """
        self.geometry = Geometry(source, target)
        self.maximum_step_m = maximum_step_m
        self._ray_length = target.lookup.ray_length.astype(np.float32)
        reach = _REACH * max(target.fx / source.fx, target.fy / source.fy) / source.lookup.ray_length
        self._reach = reach.astype(np.float32)
        self._each = each
        self._bands = bands(target.height, parts)

    def warp(self, distance: NDArray[np.floating]) -> "WarpedDepth":
        """Radial distances (h, w) [m] of the source, NaN without return, in the view.

        Raises:
            WarpError: nothing in the view, or wrong units; names the cause.
        """
        errors.check(distance, self.geometry.source, self.geometry.target)
        points = self.geometry.see(distance)
        nearness = np.zeros(self._ray_length.shape, np.float32)
        face = np.full(self._ray_length.shape, -1, np.int32)
        buffer = raster.ZBuffer(nearness, face)
        warped = np.empty(self._ray_length.shape, np.float32)

        def work(rows: tuple[int, int]) -> None:
            raster.cover(points.source, self.maximum_step_m, rows, buffer)
            shading.measure(face, nearness, self._ray_length, *rows, warped)

        for _ in self._each(work, self._bands):
            pass
        raster.fray(points.source, self.maximum_step_m, self._reach, buffer, warped)
        if not (face >= 0).any():
            raise errors.nothing_seen(points, self.geometry.target, self.maximum_step_m)
        return WarpedDepth(warped, points, self.geometry, self.maximum_step_m, face, nearness)


@dataclass(frozen=True, slots=True, eq=False)
class WarpedDepth:
    """Depth image in another view, with its correspondences.

    Attributes:
        distance: radial distances from the view's centre (height, width) [m], NaN where unknown.
        points: the source's points in the view.
        geometry: of the two cameras.
        maximum_step_m: as in `MeshWarp`.
        face: index of the face that covers a pixel (`calib.warp.raster`), −1 if none.
        nearness: 1/z of that face at the pixel [1/m].
    """

    distance: NDArray[np.float32]
    points: Points
    geometry: Geometry
    maximum_step_m: float
    face: NDArray[np.int32]
    nearness: NDArray[np.float32]

    def hidden(self) -> NDArray[np.bool_]:
        """Pixels (height, width) that the view sees but that are occluded for the source; their distance is unknown."""
        torn = np.zeros(self.face.shape, np.bool_)
        points = self.points
        raster.tear(points.source, self.maximum_step_m, torn)
        return torn & (self.face < 0)

    def index(self) -> NDArray[np.int32]:
        """Flat index of the nearest source pixel for each pixel of the view (height, width), −1 if none."""
        result = np.empty(self.face.shape, np.int32)
        shading.nearest(*self._faces(), result)
        return result

    def nearest(self, image: NDArray[Value], missing: float = np.nan) -> NDArray[Value]:
        """Image (h, w, …) of the source in the view by nearest neighbour: confidences, colours, labels."""
        index = self.index()
        flat = image.reshape(-1, *image.shape[2:])
        result = flat[np.maximum(index, 0)]
        result[index < 0] = missing
        return result

    def blended(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """Image (h, w) of the source in the view, linearly interpolated: amplitudes; NaN where unknown."""
        result = np.empty(self.face.shape, np.float32)
        shading.blend(*self._faces(), np.ascontiguousarray(image, np.float32).ravel(), result)
        return result

    def deviation(self, sigma: NDArray[np.floating]) -> NDArray[np.float32]:
        """Deviation of the warped distances (height, width) [m], for deviations of the source's (h, w) [m].

        Propagated noise plus the interpolation error of the faces. Errors of neighbours with common source pixels are
        correlated.
        """
        given = np.ascontiguousarray(np.broadcast_to(sigma, self.points.distance.shape), np.float32)
        bend, result = np.empty_like(given), np.empty(self.face.shape, np.float32)
        bending.bending(self.points.distance, given, self.maximum_step_m, bend)
        geometry = self.geometry
        view_rays = geometry.target.lookup.rays.astype(np.float32)
        flat = (self.points.distance.ravel(), geometry.rays.reshape(-1, 3), geometry.shift, view_rays)
        shading.deviate(*self._faces(), *flat, given.ravel(), bend.ravel(), result)
        return result

    def _faces(self) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        return self.face, self.nearness, self.points.place, self.points.inverse_z

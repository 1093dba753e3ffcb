"""What one camera sees of a scene: the wall once for all, the sheet anew for every exposure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from drivers.simulated.motion import Placement
from drivers.simulated.raycast import cast, shadowed, soften_edges
from drivers.simulated.scene import WALL_Z, Scene

#: The sheet is found in the image by a grid of this many points per side; the margin [px] covers what lies between.
_OUTLINE_POINTS = 13
_MARGIN = 3


@dataclass(frozen=True, eq=False)
class Sight:
    """What a region of an image sees, noise-free; every array covers the region (height, width).

    Attributes:
        region: rows and columns of the image; outside there is the wall alone.
        share: part of each pixel that the sheet fills, 0 to 1.
        distance: radial distance of the sheet [m], NaN where the share is 0; so for the other two.
        cosine: of the angle of incidence on the sheet.
        albedo: red, green, blue and infra-red reflectivity of the sheet, (height, width, 4); 0 where the share is 0.
    """

    region: tuple[slice, slice]
    share: NDArray[np.float32]
    distance: NDArray[np.float32]
    cosine: NDArray[np.float32]
    albedo: NDArray[np.float32]


class View:
    """A scene through one camera.

    Attributes:
        rays: unit direction of every pixel in the sensor frame, (height, width, 3).
        wall: what the camera would see without the sheet: a `Sight` of the whole image, its `share` 1.
    """

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self._scene = scene
        self._camera = camera
        self.rays = np.ascontiguousarray(camera.rays())
        self.wall = self._look_at_wall()

    def look(self, placement: Placement) -> Sight:
        """What the camera sees of the sheet."""
        region = self._region(placement)
        rays = np.ascontiguousarray(self.rays[region])
        T_bs, shape = self._into_bend(placement), self._shape(placement)
        sight, share = cast(rays, T_bs, shape)
        soften_edges(rays, T_bs, shape, sight, share)
        distance, a, b, cosine = sight
        return Sight(region, share, distance, cosine, self._scene.texture.at(a, b))

    def shadow(
        self,
        placement: Placement,
        distance: NDArray[np.float32],
        region: tuple[slice, slice],
        light_s: tuple[float, float, float],
    ) -> NDArray[np.bool_]:
        """Where in a region (height, width) the sheet keeps a light from what the pixels see.

        Args:
            placement: of the sheet.
            distance: radial distance that the pixels of the region see [m].
            region: rows and columns of the image.
            light_s: position of the light in the sensor frame [m].
        """
        T_bs = self._into_bend(placement)
        points_b = pose.transform(T_bs, self.rays[region] * distance[..., None].astype(np.float64))
        return shadowed(points_b, pose.transform(T_bs, np.asarray(light_s)), self._shape(placement))

    def _look_at_wall(self) -> Sight:
        directions_r = self.rays @ self._camera.T_rs[:3, :3].T
        with np.errstate(divide="ignore"):
            distance = (WALL_Z - self._camera.center[2]) / directions_r[..., 2]
        distance = np.where((distance > 0) & np.isfinite(distance), distance, np.nan)
        points_r = (self._camera.center + directions_r * distance[..., None]).astype(np.float32)
        return Sight(
            region=(slice(0, self._camera.height), slice(0, self._camera.width)),
            share=np.ones_like(distance, np.float32),
            distance=distance.astype(np.float32),
            cosine=np.abs(directions_r[..., 2]).astype(np.float32),
            albedo=self._scene.wall.at(points_r[..., 0], points_r[..., 1]),
        )

    def _region(self, placement: Placement) -> tuple[slice, slice]:
        """Rows and columns that contain the sheet, empty when it is out of sight."""
        pixels = self._camera.project(self._scene.grid(placement, _OUTLINE_POINTS, _OUTLINE_POINTS)).reshape(-1, 2)
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if not pixels.size:
            return slice(0, 0), slice(0, 0)
        size = np.array([self._camera.width, self._camera.height])
        low = np.clip(np.floor(pixels.min(axis=0)) - _MARGIN, 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)) + _MARGIN + 1, 0, size).astype(int)
        return slice(low[1], high[1]), slice(low[0], high[0])

    def _into_bend(self, placement: Placement) -> NDArray[np.float64]:
        return np.ascontiguousarray(pose.inverse(placement.T_rb) @ self._camera.T_rs)

    def _shape(self, placement: Placement) -> NDArray[np.float64]:
        return np.array(
            [
                placement.curvature,
                np.cos(placement.direction),
                np.sin(placement.direction),
                placement.offset,
                self._scene.width / 2,
                self._scene.height / 2,
            ]
        )

"""Ray casting of a scene for one camera: the wall once, the bodies in every exposure."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from drivers.simulated.scene.body import Body, RayImage
from drivers.simulated.scene.scene import Moment, Scene

#: Margin around a body's outline [px].
_MARGIN = 3


@dataclass(frozen=True, eq=False)
class BodyImage(RayImage):
    """Ray casting result of one body in an image region.

    Attributes:
        region: rows and columns of the image that contain the body.
    """

    region: tuple[slice, slice]


class View:
    """View of a scene from one camera.

    Attributes:
        rays: unit direction of every pixel in the sensor frame, (height, width, 3).
    """

    def __init__(self, scene: Scene, camera: Camera) -> None:
        self._scene = scene
        self._camera = camera
        self.rays = np.ascontiguousarray(camera.rays())

    @cached_property
    def wall(self) -> BodyImage:
        """The wall without bodies: an image of all pixels with `share` 1. Who only opens the device needs no kernel."""
        T_ws = pose.inverse(self._scene.T_rw) @ self._camera.T_rs
        directions_w = self.rays @ T_ws[:3, :3].T
        with np.errstate(divide="ignore"):
            distance = -T_ws[2, 3] / directions_w[..., 2]
        distance = np.where((distance > 0) & np.isfinite(distance), distance, np.nan)
        points_w = (T_ws[:3, 3] + directions_w * distance[..., None]).astype(np.float32)
        return BodyImage(
            share=np.ones_like(distance, np.float32),
            distance=distance.astype(np.float32),
            cosine=np.abs(directions_w[..., 2]).astype(np.float32),
            albedo=self._scene.wall.at(points_w[..., 0], points_w[..., 1]),
            region=(slice(0, self._camera.height), slice(0, self._camera.width)),
        )

    def look(self, moment: Moment) -> tuple[BodyImage, ...]:
        """Image of each body, occluding ones after occluded ones."""
        return tuple(self._look_at(body) for body in moment.bodies)

    def shadow(
        self,
        body: Body,
        distance: NDArray[np.float32],
        region: tuple[slice, slice],
        light_s: tuple[float, float, float],
    ) -> NDArray[np.bool_]:
        """Shadow mask (height, width) of an image region: True where a body blocks a light.

        Args:
            body: the shadowing body.
            distance: radial distances in the region [m].
            region: rows and columns of the image.
            light_s: position of the light in the sensor frame [m].
        """
        points_s = self.rays[region] * distance[..., None].astype(np.float64)
        return body.shadowed(points_s, np.asarray(light_s), self._camera.T_rs)

    def _look_at(self, body: Body) -> BodyImage:
        region = self._region(body)
        seen = body.cast(np.ascontiguousarray(self.rays[region]), self._camera.T_rs)
        return BodyImage(seen.share, seen.distance, seen.cosine, seen.albedo, region)

    def _region(self, body: Body) -> tuple[slice, slice]:
        """Rows and columns that contain a body, empty if it is out of view."""
        pixels = self._camera.project(body.outline()).reshape(-1, 2)
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if not pixels.size:
            return slice(0, 0), slice(0, 0)
        size = np.array([self._camera.width, self._camera.height])
        low = np.clip(np.floor(pixels.min(axis=0)) - _MARGIN, 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)) + _MARGIN + 1, 0, size).astype(int)
        return slice(low[1], high[1]), slice(low[0], high[0])

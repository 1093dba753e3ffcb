"""Sparse synthesis on warped input (section 3.2): all images in one common projection without distortion (eq. 12)."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import ModelError, Surface
from abs_service.tracker.synthesis.base import ObservedView, Synthesis, View
from abs_service.tracker.synthesis.sparse import SparseView
from abs_service.tracker.synthesis.window import WHOLE
from calib.camera import Camera
from calib.noise.base import DepthNoise, subtract_mean_offset
from calib.rig import Rig
from calib.warp.errors import WarpError
from calib.warp.mesh import MeshWarp, WarpedDepth
from calib.warp.pictures import PictureLookup
from calib.warp.pinhole import pinhole_of


@dataclass(frozen=True)
class Settings:
    """TOML keys of the warping.

    Attributes:
        sensor: depth sensor into whose view, without distortion, all images are warped; images of cameras without
            distances are warped by its distances. "" is the tracker's first depth sensor.
    """

    sensor: str = ""

    def build(self, rig: Rig, mesh: Mesh) -> "WarpedSynthesis":
        """The synthesis of a mesh for the sensors of a rig.

        Raises:
            ModelError: the sensor does not exist or measures no distances.
        """
        depth = [name for name, sensor in rig.sensors.items() if isinstance(sensor.noise, DepthNoise)]
        if not depth or self.sensor not in ("", *depth):
            raise ModelError(
                f'synthesis.sensor = "{self.sensor}" must be a depth sensor of the tracker, one of {depth}'
            )
        return WarpedSynthesis(rig, mesh, self.sensor or depth[0])


class WarpedSynthesis:
    """One common projection for all sensors."""

    resamples = True

    def __init__(self, rig: Rig, mesh: Mesh, reference: str):
        self.canvas = mesh
        self._rig = rig
        self._reference = reference
        self._camera = pinhole_of(rig.sensors[reference].camera)
        self._common = _CommonView(self._camera, mesh)
        self._warps = {
            name: MeshWarp(sensor.camera, self._camera)
            for name, sensor in rig.sensors.items()
            if isinstance(sensor.noise, DepthNoise)
        }
        self._pictures = {name: PictureLookup(self._camera, rig.sensors[name].camera) for name in rig.sensors}

    def observe(self, observation: Observation) -> "WarpedImages":
        """The images, warped by the distances of the reference sensor."""
        return WarpedImages(self._camera, self._warps, self._pictures, self._distance(observation))

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the vertices with attributes (n, channels) in the common camera."""
        return _SharedView(self._common, attributes)

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The whole image: images are resampled completely."""
        return WHOLE

    def _distance(self, observation: Observation) -> NDArray[np.float32]:
        """Distances (height, width) [m] of the reference sensor in the common view; NaN where unknown."""
        image, sensor = observation.images.get(self._reference), self._rig.sensors[self._reference]
        if isinstance(image, DepthImage) and isinstance(sensor.noise, DepthNoise):
            measured = subtract_mean_offset(sensor.noise, image.distance, image.amplitude)
            warped = _warp(self._warps[self._reference], measured)
            if warped is not None:
                return warped.distance
        return np.full((self._camera.height, self._camera.width), np.nan, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class WarpedImages:
    """The images of one frame in the common view.

    Attributes:
        camera: of the common view.
        warps: of the depth sensors.
        pictures: of all sensors' images.
        distance: of the reference sensor in the common view (height, width) [m]; NaN where unknown.
    """

    camera: Camera
    warps: dict[str, MeshWarp]
    pictures: dict[str, PictureLookup]
    distance: NDArray[np.float32]

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The noise texture (height + 2, width + 2, 8) in the common view.

        Distances are measured from the common camera; σ along the original line of sight is used for the new one, which
        is exact up to the cosine of the angle between them.
        """
        inner = texture[1:-1, 1:-1]
        result = np.zeros((self.camera.height + 2, self.camera.width + 2, texture.shape[2]), np.float32)
        warped = _warp(self.warps[sensor], np.where(inner[..., 3] > 0, inner[..., 0], np.float32(np.nan)))
        if warped is not None:
            result[1:-1, 1:-1] = warped.nearest(inner, missing=0)
            result[1:-1, 1:-1, 0] = np.nan_to_num(warped.distance)
        return result

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (height, width, channels) in the common view; NaN where the distance is unknown."""
        try:
            return self.pictures[sensor].look(self.distance).nearest(image)
        except WarpError:  # the image is unknown: the cost is that of an unseen object
            return np.full((*self.distance.shape, image.shape[2]), np.nan, np.float32)


def _warp(warp: MeshWarp, distance: NDArray[np.floating]) -> WarpedDepth | None:
    """A depth sensor's distances in the common view; None if all lie outside it, for example without an object."""
    try:
        return warp.warp(distance)
    except WarpError:
        return None


class _SharedView:
    """One sensor's attributes in the common view, which is that of the vertices for all else."""

    def __init__(self, common: "_CommonView", attributes: NDArray[np.float32]):
        self.camera, self.render = common.camera, common.render
        self._common = common
        self._attributes = np.ascontiguousarray(attributes.T, np.float32)[None]

    def observe(self, predicted: Surface) -> "_ObservedSharedView":
        """The view in one frame."""
        return _ObservedSharedView(self.camera, self._common.observe(predicted), self._attributes)

    def observe_rendered(self, predicted: Surface) -> tuple["_ObservedSharedView", NDArray[np.float32]]:
        """View of one frame and its rendered distances; the view is that of all sensors."""
        return self.observe(predicted), self.render(predicted)


class _CommonView:
    """The vertices in the common camera, observed once in a frame for all sensors."""

    def __init__(self, camera: Camera, mesh: Mesh):
        view = SparseView(camera, mesh.faces, np.zeros((len(mesh.vertices), 0), np.float32))
        self.camera, self.render = camera, view.render
        self.observe = lru_cache(maxsize=1)(lambda predicted: _ObservedCommonView(view.observe(predicted)))


class _ObservedCommonView:
    """The same in one frame; what all sensors ask for one after the other is synthesised once."""

    def __init__(self, view: ObservedView):
        self.synthesize = lru_cache(maxsize=1)(view.synthesize)


@dataclass(frozen=True, slots=True, eq=False)
class _ObservedSharedView:
    """One sensor's attributes (1, channels, n) in the common view of a frame."""

    camera: Camera
    common: _ObservedCommonView
    attributes: NDArray[np.float32]

    def synthesize(self, surface: Surface) -> Synthesis:
        """The common synthesis with this sensor's attributes."""
        return replace(self.common.synthesize(surface), attributes=self.attributes)

    def attribute_gradients(self, seen: Synthesis) -> NDArray[np.float32]:
        """NaN: only the vertices' own attributes are known."""
        return np.full((*self.attributes[0].T.shape, 2), np.nan, np.float32)

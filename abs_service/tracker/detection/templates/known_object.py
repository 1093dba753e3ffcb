"""An object of known shape: its mesh, placed where the first depth image shows it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import at_points
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.shapes.paint import NO_PAINT, Paint
from abs_service.tracker.detection.shapes.registration import register, registration_deviation
from abs_service.tracker.detection.shapes.samples import Samples
from abs_service.tracker.detection.templates.base import BindsToMesh, Model_co, ModelSettings, Sight
from abs_service.tracker.mesh import Mesh
from calib import pose
from calib.pose import Pose

#: A vertex is seen if the depth image agrees with its distance within this, or within 4 σ if that is more [m].
MIN_AGREEMENT_M, AGREEMENT_DEVIATIONS = 0.01, 4.0


class KnownObject:
    """A template whose mesh is known before the object is seen.

    Args:
        mesh: in the object's own frame [m].
        samples: points of its surface, for the registration.
        paint: its colours.
    """

    def __init__(self, mesh: Mesh, samples: Samples, paint: Paint = NO_PAINT):
        self._mesh = mesh
        self._samples = samples
        self._paint = paint

    def bind(self, model: ModelSettings[Model_co], detection: InitialDetection) -> tuple[Model_co, Sight]:
        """The model bound to the mesh where the registration finds it; see `Template`."""
        if not isinstance(model, BindsToMesh):
            raise DetectionError("the model finds its object by itself and cannot be bound to a template")
        T_ro = register(self._samples, detection)
        vertices = pose.transform(T_ro, self._mesh.vertices)
        mesh = replace(self._mesh, vertices=vertices, pixel_deviation=detection.deviation)
        if not self._samples.is_closed:
            mesh = _towards(detection.camera.center, mesh)
        return model.of_mesh(mesh), FirstSight(detection, self._paint, T_ro, registration_deviation(self._samples))


def _towards(center: NDArray[np.float64], mesh: Mesh) -> Mesh:
    """An open mesh whose faces, most of them, are turned towards a camera's centre (3,)."""
    facing = np.einsum("ni,ni->n", mesh.normals, mesh.vertices - center) < 0
    return mesh if np.mean(facing) >= 0.5 else replace(mesh, faces=mesh.faces[:, ::-1].copy())


@dataclass(frozen=True, eq=False)
class FirstSight:
    """Appearance of a known object that is placed in the first depth image.

    Attributes:
        detection: the first depth image.
        paint: the template's colours.
        T_ro: pose of the object.
        registration_m: standard deviation of its place [m].
    """

    detection: InitialDetection
    paint: Paint
    T_ro: Pose
    registration_m: float

    def seen(self, mesh: Mesh) -> NDArray[np.bool_]:
        """True for vertices (n,) that face the depth camera where a pixel of the object agrees with their distance."""
        camera, distance = self.detection.camera, self.detection.distance
        sight = mesh.vertices - camera.center
        away, facing = np.linalg.norm(sight, axis=1), np.einsum("ni,ni->n", mesh.normals, sight) < 0
        agreement = max(MIN_AGREEMENT_M, AGREEMENT_DEVIATIONS * self.detection.deviation)
        measured = at_points(distance, camera, mesh.vertices)
        return facing & (np.abs(measured - away) < agreement)  # False for NaN

    def colors(self, mesh: Mesh) -> NDArray[np.float32]:
        """Colours (n, 3) of the vertices by the template."""
        return self.paint.at(pose.transform(pose.inverse(self.T_ro), mesh.vertices), mesh.normals @ self.T_ro[:3, :3])

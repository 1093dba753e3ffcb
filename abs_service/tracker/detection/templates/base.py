"""Interface of templates."""

from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh

Model_co = TypeVar("Model_co", covariant=True)


class ModelSettings(Protocol[Model_co]):
    """Settings of a deformation model that finds its mesh in the first depth image."""

    def build(self, detection: InitialDetection) -> Model_co:
        """The model of a detected object."""
        ...


@runtime_checkable
class BindsToMesh(Protocol[Model_co]):
    """Settings of a deformation model that can be bound to a mesh."""

    def of_mesh(self, mesh: Mesh) -> Model_co:
        """The model of an object whose mesh at rest is known, in rig coordinates.

        Raises:
            ModelError: the model cannot be bound to this mesh.
        """
        ...


class Sight(Protocol):
    """Knowledge of the surface's place and appearance from the template and the first depth image."""

    @property
    def registration_m(self) -> float:
        """Standard deviation of the place of the mesh at rest; 0 if the first depth image defines it [m]."""
        ...

    def seen(self, mesh: Mesh) -> NDArray[np.bool_]:
        """True for the vertices (n,) that the first depth image shows."""
        ...

    def colors(self, mesh: Mesh) -> NDArray[np.float32]:
        """Red, green and blue (n, 3) of the vertices by the template; NaN where unknown."""
        ...


class AllSeen:
    """Sight of a mesh that was made from the first depth image: it shows every vertex."""

    registration_m: float = 0.0

    def seen(self, mesh: Mesh) -> NDArray[np.bool_]:
        """True for all vertices (n,)."""
        return np.ones(len(mesh.vertices), np.bool_)

    def colors(self, mesh: Mesh) -> NDArray[np.float32]:
        """NaN (n, 3)."""
        return np.full((len(mesh.vertices), 3), np.nan, np.float32)


ALL_SEEN = AllSeen()


class Template(Protocol):
    """Makes the model of a detected object from its known shape."""

    def bind(self, model: ModelSettings[Model_co], detection: InitialDetection) -> tuple[Model_co, Sight]:
        """The model, at rest in the detected pose, and its known appearance.

        Raises:
            DetectionError: the object is not that of the template, or the model finds no object of its kind.
            ModelError: the model cannot be bound to the mesh.
        """
        ...

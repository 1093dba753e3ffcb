"""Illumination models: brightness of a surface from its reflectivity, one class per kind of light."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesis
from abs_service.tracker.terms.photometric.exposure import gains
from calib.jit import kernel

#: Gain of an image that is exposed as the first one.
_NEUTRAL = np.ones(1, np.float32)


class Illumination(Protocol):
    """Converts reflectivities into image values."""

    def adapt(self, measured: NDArray[np.floating], expected: NDArray[np.floating]) -> "Illumination":
        """The illumination with the exposure of an image; see `gains` for what is measured and expected."""
        ...

    def illuminate(self, seen: Synthesis, surface: Surface) -> Synthesis:
        """The synthesis of a population with its attributes as they look in this light."""
        ...


class Passive:
    """The light of the room: a vertex looks the same wherever it is."""

    def adapt(self, measured: NDArray[np.floating], expected: NDArray[np.floating]) -> "Passive":
        """Itself."""
        return self

    def illuminate(self, seen: Synthesis, surface: Surface) -> Synthesis:
        """The synthesis itself."""
        return seen


class Exposed:
    """The light of the room, seen by a camera that adapts exposure and white balance.

    Args:
        exposure: gain of every channel, or of all (channels or 1,).
    """

    def __init__(self, exposure: NDArray[np.float32] = _NEUTRAL):
        self._gains = exposure

    def adapt(self, measured: NDArray[np.floating], expected: NDArray[np.floating]) -> "Exposed":
        """The light with the gains of an image."""
        return Exposed(gains(measured, expected))

    def illuminate(self, seen: Synthesis, surface: Surface) -> Synthesis:
        """The synthesis with its attributes as the image is exposed."""
        return replace(seen, attributes=seen.attributes * self._gains[:, None])


class Active:
    """A lamp beside the sensor: reflectivity · cosine of incidence / distance² (Lambert).

    Args:
        center: of the camera (3,) [m].
    """

    def __init__(self, center: NDArray[np.float64]):
        self._center = center.astype(np.float32)

    def adapt(self, measured: NDArray[np.floating], expected: NDArray[np.floating]) -> "Active":
        """Itself: the lamp and the sensor's exposure are one, and known."""
        return self

    def illuminate(self, seen: Synthesis, surface: Surface) -> Synthesis:
        """The synthesis with reflectivities as bright as they look on each member of the population."""
        shade = lambert(surface, self._center)
        return replace(seen, attributes=seen.attributes * seen.interpolation.carry(shade)[:, None])


def lambert(surface: Surface, center: NDArray[np.floating]) -> NDArray[np.float32]:
    """Cosine of incidence over squared distance (population, n) [1/m²] of vertices lit from `center` (3,) [m]."""
    population, _, n = surface.vertices.shape
    shade = np.empty((population, n), np.float32)
    _lambert(surface.vertices, surface.normals, center.astype(np.float32), shade)
    return shade


@kernel
def _lambert(
    vertices: NDArray[np.float32], normals: NDArray[np.float32], center: NDArray[np.float32], shade: NDArray[np.float32]
) -> None:
    """Lambert's law with the lamp at the centre; surfaces that face away are dark."""
    x, y, z = center
    for k in range(vertices.shape[0]):
        for v in range(vertices.shape[2]):
            a, b, c = x - vertices[k, 0, v], y - vertices[k, 1, v], z - vertices[k, 2, v]
            square = a * a + b * b + c * c
            along = a * normals[k, 0, v] + b * normals[k, 1, v] + c * normals[k, 2, v]
            shade[k, v] = max(along, np.float32(0)) / (square * np.sqrt(square))

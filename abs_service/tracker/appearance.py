"""Appearance of the vertices: their colours, and their values in each imaging sensor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from abs_service.pairing.images import Image
from abs_service.tracker.measurements import measurement
from abs_service.tracker.measurements.base import ColorKind, FirstImages
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.photometric.vertex_values import Values, at_vertices, known, mean_of_known
from calib.noise.base import ImageNoise
from calib.rig import Rig


def with_appearance(mesh: Mesh, images: Mapping[str, Image], rig: Rig) -> Mesh:
    """The mesh with its colours, and with its appearance in every imaging sensor.

    The appearance comes from the sensor's own image, because no two cameras agree on a colour; for vertices that it
    did not see, from the other sensors' colours. Only a Bayer sensor prefers the colour sensors, which measure all
    three channels of a vertex.

    Args:
        mesh: the mesh at the time of the images.
        images: images of that moment, by sensor name.
        rig: the sensors.
    """
    seen = {name: at_vertices(image, rig.sensors[name].camera, mesh) for name, image in images.items()}
    first = FirstImages(mesh, images, rig, _colors(mesh, seen, rig))
    nothing = np.full((len(mesh.vertices), 1), np.nan)
    appearance = {
        name: measurement(sensor.noise).appearance(seen.get(name, nothing), sensor, first).astype(np.float32)
        for name, sensor in rig.sensors.items()
        if isinstance(sensor.noise, ImageNoise)
    }
    return replace(mesh, colors=first.colors.astype(np.float32), appearance=appearance)


def _colors(mesh: Mesh, seen: Mapping[str, Values], rig: Rig) -> Values:
    """Red, green and blue (n, 3) of the vertices: of the colour sensors, else of the Bayer sensors, else grey."""
    kinds = {name: measurement(rig.sensors[name].noise) for name in seen}
    ranked: dict[int, list[Values]] = {}
    for name, kind in kinds.items():
        if isinstance(kind, ColorKind):
            ranked.setdefault(kind.color_rank, []).append(kind.colors(seen[name]))
    colors = np.full((len(mesh.vertices), 3), np.nan)
    for rank in sorted(ranked):
        colors = known(colors, mean_of_known(ranked[rank], colors.shape))
    return colors

"""Appearance of the vertices: their colours, and their values in each imaging sensor."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from abs_service.pairing.images import LUMA, Image
from abs_service.tracker.detection.templates.base import ALL_SEEN, Sight
from abs_service.tracker.measurements import measurement
from abs_service.tracker.measurements.base import ColorKind, FirstImages
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.photometric.vertex_values import Values, at_vertices, known, mean_of_known
from calib.noise.base import ImageNoise
from calib.rig import Rig


def with_appearance(mesh: Mesh, images: Mapping[str, Image], rig: Rig, sight: Sight = ALL_SEEN) -> Mesh:
    """The mesh with its colours, and with its appearance in every imaging sensor.

    The appearance comes from the sensor's own image, because no two cameras agree on a colour; for vertices that it
    did not see, from the other sensors' colours. Only a Bayer sensor prefers the colour sensors, which measure all
    three channels of a vertex.

    Args:
        mesh: the mesh at the time of the images.
        images: images of that moment, by sensor name.
        rig: the sensors.
        sight: what a template knows. Vertices that the first depth image does not show get no appearance from the
            images. Colours of the template count for all vertices in place of the images', which only say how bright
            they are in each sensor and channel; infra-red and amplitudes, of which a template knows nothing, excepted.
    """
    seen = {name: at_vertices(image, rig.sensors[name].camera, mesh) for name, image in images.items()}
    first = FirstImages(mesh, images, rig, _colors(mesh, seen, rig))
    nothing = np.full((len(mesh.vertices), 1), np.nan)
    shown, painted = sight.seen(mesh)[:, None], sight.colors(mesh).astype(np.float64)
    appearance = {}
    for name, sensor in rig.sensors.items():
        if isinstance(sensor.noise, ImageNoise):
            kind = measurement(sensor.noise)
            values = np.where(shown, kind.appearance(seen.get(name, nothing), sensor, first), np.nan)
            if isinstance(kind, ColorKind):
                values = _painted(values, painted @ LUMA[:, None] if values.shape[1] == 1 else painted)
            appearance[name] = values.astype(np.float32)
    colors = _painted(np.where(shown, first.colors, np.nan), painted)
    return replace(mesh, colors=colors.astype(np.float32), appearance=appearance)


def _painted(measured: Values, painted: Values) -> Values:
    """Known colours (n, channels) as bright as measured ones, in the median; where unknown, the measured ones."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(painted > 0, measured / painted, np.nan)
    compared = np.isfinite(ratio)
    gain = [np.median(ratio[one, c]) if (one := compared[:, c]).any() else 1.0 for c in range(painted.shape[1])]
    return known(painted * gain, measured)


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

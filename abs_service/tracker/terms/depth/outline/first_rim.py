"""Classes of a mesh's rim in the first depth image, without a term: initial classes of a tracker's outline."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from calib.camera import Camera


def classified_rim(
    camera: Camera, mesh: Mesh, surface: Surface, distance: NDArray[np.float32]
) -> tuple[Rim, NDArray[np.uint8]]:
    """The rim of a mesh, and the `RimClass` (k,) of its outer vertices.

    Args:
        camera: the depth camera.
        mesh: the mesh.
        surface: the mesh in the image, a population of one.
        distance: radial distances (height, width) [m] without mean offset, NaN without return.
    """
    expected = Raster(camera, mesh.faces).render(surface.vertices[0])
    seen = Classifier(camera).classify(distance, expected, WHOLE, distance.shape)
    rim = Rim.of(mesh)
    # The classes do not depend on the standard deviation, which says how far from the outline distances are known.
    outline = RimOutline(camera, rim, deviation=1.0)
    outline.observe(distance, seen, expected, surface)
    return rim, outline.classes

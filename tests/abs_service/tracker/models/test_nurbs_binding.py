"""A mesh that a NURBS surface cannot follow closely is bound to a smoother one, or refused."""

import numpy as np
import pytest

from abs_service.tracker.models.base import ModelError
from abs_service.tracker.models.nurbs import Settings
from tests.abs_service.tracker.scenes import flat, sheet


def test_a_mesh_that_the_surface_cannot_follow_is_refused():
    """Steps of a metre are not a smooth surface of 3 × 3 control points; its normals miss the vertices there."""
    mesh = sheet(height=lambda x, y: flat(x, y) + (np.sin(60 * x) > 0))
    with pytest.raises(ModelError, match="away from the normal of its closest surface point"):
        Settings(control_points=(3, 3), degree=2).of_mesh(mesh)


def test_a_limb_that_is_too_sharp_for_the_surface_is_left_to_the_offsets():
    """As the legs of a toy: a rest surface that followed it would fold, and the normals miss vertices beside it."""
    limb = sheet(height=lambda x, y: flat(x, y) - 0.12 * np.exp(-((x - 0.05) ** 2 + y**2) / 0.03**2))
    model = Settings().of_mesh(limb)
    order = np.lexsort(model.mesh.colors.T), np.lexsort(limb.colors.T)
    np.testing.assert_allclose(model.mesh.vertices[order[0]], limb.vertices[order[1]], atol=1e-3)

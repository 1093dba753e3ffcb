"""A model remembers the surface that it was asked for last."""

import numpy as np

from abs_service.tracker.models.nurbs import Settings
from tests.abs_service.tracker.scenes import sheet


def test_the_last_surface_is_kept_until_parameters_or_offsets_change():
    model = Settings(control_points=(4, 4)).of_mesh(sheet(5, 6))
    thetas = model.rest[None].copy()
    first = model.deform(thetas)
    assert model.deform(model.rest[None]) is first
    thetas += 0.01  # the model has a copy
    np.testing.assert_allclose(model.deform(thetas).vertices, first.vertices + np.float32(0.01), atol=1e-6)
    before = model.deform(model.rest[None])
    model.set_offsets(model.offset.astype(float) + 1e-3, np.full(30, 1e-3))
    moved = model.deform(model.rest[None]).vertices - before.vertices
    np.testing.assert_allclose(np.linalg.norm(moved[0], axis=0), 1e-3, rtol=1e-3)

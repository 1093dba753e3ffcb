"""A frame deforms and synthesises a theta once, in whatever order it is asked."""

import numpy as np

from abs_service.tracker.models.nurbs import Settings
from abs_service.tracker.posterior.surfaces import FrameSurfaces
from abs_service.tracker.synthesis.sparse import SparseView
from tests.abs_service.tracker.scenes import CAMERA, sheet


def test_a_frame_deforms_a_theta_once_and_another_frame_anew():
    model = Settings(control_points=(4, 4)).of_mesh(sheet(5, 6))
    frame, theta = FrameSurfaces(model), model.rest[None].copy()
    first = frame.deform(theta)
    theta += 0.01  # the frame knows numbers, not the array
    other = frame.deform(theta)
    np.testing.assert_allclose(other.vertices, first.vertices + np.float32(0.01), atol=1e-6)
    assert frame.deform(model.rest[None]) is first
    assert frame.deform(theta) is other
    both = frame.deform(np.concatenate([model.rest[None], theta]))
    np.testing.assert_array_equal(both.vertices, np.concatenate([first.vertices, other.vertices]))
    model.set_offsets(model.offset.astype(float) + 1e-3, np.full(30, 1e-3))
    moved = FrameSurfaces(model).deform(model.rest[None]).vertices - first.vertices
    np.testing.assert_allclose(np.linalg.norm(moved[0], axis=0), 1e-3, rtol=1e-3)


def test_a_sensor_synthesises_a_surface_once_in_a_frame():
    model = Settings(control_points=(4, 4)).of_mesh(mesh := sheet(5, 6))
    away = model.rest + np.tile([0.0, 0.0, 1.0], len(model.rest) // 3)
    front, back, view = (
        model.deform(model.rest[None]),
        model.deform(away[None]),
        SparseView(CAMERA, mesh.faces, mesh.colors),
    )
    frame = view.observe(front)
    seen = frame.synthesize(front)
    frame.synthesize(back)
    assert frame.synthesize(front) is seen
    again = view.observe(front).synthesize(front)
    assert again is not seen
    np.testing.assert_array_equal(again.pixel, seen.pixel)

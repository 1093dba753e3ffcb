"""Edges on the outline of the object hold a mesh; those on that of something else do not."""

import numpy as np

from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from tests.abs_service.tracker.terms.depth.outline.outline_scene import CAMERA, MESH, begun, look, picture


def test_edges_at_the_far_side_of_a_gap_in_the_object_hold_nothing():
    """The mesh hangs over a gap beside its object, its right side at what is beyond it; the other sides hold it."""
    known, (rays_x, on) = begun(picture()), _columns()
    right = MESH.vertices[:, 0].max()
    beyond = np.where(on & (rays_x > right - 0.04) & (rays_x < right + 0.06), picture(MESH, 0.06), picture())
    beyond[(rays_x > right - 0.04) & (rays_x < right)] = picture(MESH, -1.0)[(rays_x > right - 0.04) & (rays_x < right)]
    assert _held_sides(known, beyond) == {"down", "left", "up"}


def test_edges_that_are_on_the_outline_while_most_of_their_side_is_not_hold_nothing():
    """Something lies against most of the right side of a sheet."""
    known, (rays_x, on) = begun(picture()), _columns()
    right, most = MESH.vertices[:, 0].max(), np.arange(CAMERA.height)[:, None] < 0.6 * CAMERA.height
    touching = np.where(most & (rays_x > 0) & (rays_x < right + 0.1) & on, picture(MESH, 0.1), picture())
    assert _held_sides(known, touching) == {"down", "left", "up"}
    assert _held_sides(known, picture()) == {"right", "down", "left", "up"}


def _columns() -> tuple[np.ndarray, np.ndarray]:
    """Right of the lines of sight on the sheet (rows, columns) [m], and the rows of the sheet in all columns."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    y = rays[..., 1] / rays[..., 2]
    return rays[..., 0] / rays[..., 2], (y > MESH.vertices[:, 1].min()) & (y < MESH.vertices[:, 1].max())


def _held_sides(known: RimOutline, distance: np.ndarray) -> set[str]:
    """Sides of the sheet whose edges hold it, in an image in which it has not moved."""
    observed, model = look(known, distance), Rigid(MESH)
    linear = observed.linearize(model.deform(np.zeros((1, 6))), model.sparse_jacobian(np.zeros(6)))
    x, y = linear.places.T[:2]
    own = np.abs(linear.of_surface(linear.rows)).sum(axis=1) > 0
    (left, top), (right, bottom) = MESH.vertices[:, :2].min(axis=0), MESH.vertices[:, :2].max(axis=0)
    level, upright = (y > top + 0.02) & (y < bottom - 0.02), (x > left + 0.02) & (x < right - 0.02)  # not the corners
    sides = {"right": level & (x > 0), "down": upright & (y > 0), "left": level & (x < 0), "up": upright & (y < 0)}
    return {name for name, which in sides.items() if own[which].any()}

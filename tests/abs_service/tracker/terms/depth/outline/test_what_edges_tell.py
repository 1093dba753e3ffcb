"""Which edges hold a mesh, and what error they share."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.terms.depth.outline.observed_outline import PIXEL_PX, GapErrors, by_pixels, shared_by_side
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from tests.abs_service.tracker.terms.depth.outline.outline_scene import CAMERA, MESH, begun, look, outline, picture


def test_the_error_that_edges_share_is_in_their_gaps_from_the_first_image():
    """It cancels for a mesh that ends inside its object, but for that by whole pixels, which is one along a column."""
    small, along_x = replace(MESH, vertices=MESH.vertices * (0.92, 0.92, 1.0)), 3
    alone, later = (
        term.linearize(model.deform(np.zeros((1, 6))), model.sparse_jacobian(np.zeros(6))).shared[:, along_x]
        for term, model in (
            (outline(picture()), Rigid(MESH)),
            (look(begun(picture(), small), picture(), small), Rigid(small)),
        )
    )
    steady, by_pixels_now, by_pixels_at_first = later[:4], later[4:8], later[8:]
    assert np.linalg.norm(alone[:4]) > 10 * np.linalg.norm(steady)
    assert np.linalg.norm(by_pixels_now) > 1
    np.testing.assert_allclose(np.linalg.norm(by_pixels_now), np.linalg.norm(by_pixels_at_first), rtol=0.05)


def test_of_a_shared_error_a_mesh_keeps_what_changes_its_side_or_its_length():
    jacobian, residual, sides = np.array([[1.0], [2.0], [4.0], [8.0]]), np.full(4, 0.3), np.eye(4, dtype=bool)
    plain = GapErrors(np.eye(4), np.zeros(4), 0.5)
    oblique = partial(shared_by_side, jacobian, residual, sides, coherence=np.zeros(4))
    steady = np.sqrt(1 - PIXEL_PX**2 / 0.5**2)
    turned = oblique(taken=plain._replace(shares=np.eye(4)[[2, 3, 0, 1]]), deviation=0.5)[:, 0]
    nearer = oblique(taken=plain.grown(np.full(4, 1.25)), deviation=0.5)[:, 0]
    wandering = oblique(taken=plain, deviation=1.0)[:, 0]
    assert not oblique(taken=plain, deviation=0.5).any()
    np.testing.assert_allclose(turned[:4], steady * np.array([1 - 4, 2 - 8, 4 - 1, 8 - 2]))
    np.testing.assert_allclose(nearer[:4], -0.25 * steady * jacobian[:, 0])
    np.testing.assert_allclose(wandering, [*[0] * 4, *(np.sqrt(1 - 0.5**2) * jacobian[:, 0]), *[0] * 4])
    without_gaps = GapErrors(np.zeros((4, 4)), np.zeros(4), 0.5)
    along = shared_by_side(jacobian, residual, sides, without_gaps, np.ones(4), 0.5)
    np.testing.assert_allclose(np.square(along.reshape(3, 4)).sum(axis=0), jacobian[:, 0] ** 2)  # all of it


def test_edges_along_a_column_share_the_error_of_whole_pixels_and_oblique_ones_do_not():
    along, sides = np.stack([np.full(20, 7.3), np.arange(20.0)], axis=1), np.zeros((4, 20), bool)
    sides[0] = True
    oblique = along + np.stack([0.3 * np.arange(20), np.zeros(20)], axis=1)
    assert by_pixels(along, sides).tolist() == [pytest.approx(1), 0, 0, 0]
    assert by_pixels(oblique, sides)[0] < 0.05


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

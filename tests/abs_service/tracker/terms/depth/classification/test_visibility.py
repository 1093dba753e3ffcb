"""Occluded vertices and pixels are ignored in the cost."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.base import Surface
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.classification.background import MIN_PIXELS, Background
from abs_service.tracker.terms.depth.classification.visibility import classify, keep_free, surfaces_of
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.depth_cost import FREE_SCALE_M
from abs_service.tracker.terms.depth.observed_depth import ObservedDepth
from abs_service.tracker.terms.linearization import stack
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from tests.abs_service.tracker.scenes import (
    as_surface,
    depth_image,
    flat,
    plane_distance,
    sheet,
    sparse,
)


def board(camera: Camera, background: float = 1.6) -> np.ndarray:
    """Distances of a flat sheet at z = 1 m before a wall."""
    mesh = sheet(height=flat)
    distance = Raster(camera, mesh.faces).render(mesh.vertices.T.astype(np.float32))
    return np.where(np.isfinite(distance), distance, plane_distance(camera, np.array([0, 0, 1.0]), background))


STRAIGHT = Camera(140, 72, 220.0, 220.0, 69.5, 35.5)
MESH = sheet(height=flat)
PREDICTED = Raster(STRAIGHT, MESH.faces).render(MESH.vertices.T.astype(np.float32))
EXPECTED = np.isfinite(PREDICTED)


def test_a_sheet_before_a_wall_is_the_object_and_the_wall_is_free():
    seen = classify(surfaces_of(board(STRAIGHT).astype(np.float32)), PREDICTED, STRAIGHT.fx)
    assert np.count_nonzero(seen.object) > 0.8 * np.count_nonzero(EXPECTED)  # all but its rim
    assert not (seen.object & ~EXPECTED).any()
    assert not seen.foreground.any()
    assert not seen.hole.any()
    assert (seen.free_m[EXPECTED] == 0).all()
    assert seen.free_m[35, 24] == pytest.approx((36.5 - 24) / 220, abs=0.012)  # the sheet begins at column 36.5


def test_what_stands_before_the_sheet_is_foreground_also_beside_it():
    distance = board(STRAIGHT).astype(np.float32)
    distance[20:45, :62] = 0.85
    seen = classify(surfaces_of(distance), PREDICTED, STRAIGHT.fx)
    hand = np.zeros_like(EXPECTED)
    hand[20:45, :62] = True
    assert seen.foreground[22:43, 2:60].all()
    assert not seen.foreground[~hand].any()
    assert seen.object[:, 72:102][EXPECTED[:, 72:102]].mean() > 0.8


def test_a_hole_inside_the_outline_is_told_from_missing_returns_at_its_rim():
    distance = board(STRAIGHT).astype(np.float32)
    distance[~EXPECTED] = np.nan  # a background out of range
    distance[:, 82:] = np.nan
    seen = classify(surfaces_of(distance), PREDICTED, STRAIGHT.fx)
    assert seen.hole[30:42, 84:96].all()
    assert not seen.hole[:9].any()
    assert (seen.free_m == 0).all()


def test_a_missing_return_beside_the_sheet_is_free_space_where_the_background_has_none():
    """The sheet has moved 12 pixels (55 mm) to the left, so the prediction hangs over the empty background."""
    first = board(STRAIGHT).astype(np.float32)
    first[~EXPECTED] = np.nan
    background = Background()
    background.observe(np.isnan(first), EXPECTED, WHOLE, first.shape)
    moved = np.roll(first, -12, axis=1)
    moved[30:33, 60:64] = np.nan  # a hole in the sheet
    missing = np.isnan(moved)
    empty, _ = background.observe(missing, EXPECTED, WHOLE, first.shape)
    assert not empty[30:33, 60:64].any()
    assert np.array_equal(empty, missing & ~np.pad(np.ones((3, 4), bool), ((30, 39), (60, 76))))
    seen = classify(surfaces_of(moved), PREDICTED, STRAIGHT.fx, empty)
    row = seen.free_m[36]
    assert np.all(row[97:102] > 0)
    assert np.all(np.diff(row[97:102]) > 0)  # farther from the sheet, more to be pushed back
    assert not row[40:90].any()
    # Deeper than the object can move between two frames, a missing return is a hole all the same.
    deep = first.copy()
    deep[:, 70:] = np.nan
    deep_seen = classify(
        surfaces_of(deep), PREDICTED, STRAIGHT.fx, background.observe(np.isnan(deep), EXPECTED, WHOLE, deep.shape)[0]
    )
    assert deep_seen.hole[36, 80:92].all()
    assert np.all(deep_seen.free_m[36, 99:102] > 0)


def test_a_hole_goes_on_to_the_rim_that_it_reaches():
    distance = board(STRAIGHT).astype(np.float32)
    distance[~EXPECTED] = np.nan
    distance[:, 82:] = np.nan
    seen = classify(surfaces_of(distance), PREDICTED, STRAIGHT.fx)
    assert seen.hole[30:42, 84:104].all()  # the sheet ends at column 102.5
    assert not seen.hole[:, 107:].any()
    assert not seen.hole[:, :60].any()


def test_a_prediction_that_nothing_agrees_with_classifies_nothing():
    distance = (board(STRAIGHT) - 0.2).astype(np.float32)
    seen = classify(surfaces_of(distance), PREDICTED, STRAIGHT.fx)
    assert not seen.object.any()
    assert not seen.foreground.any()
    assert not seen.hole.any()
    assert not seen.free_m.any()


def test_a_surface_that_moved_as_a_whole_is_still_the_object():
    distance = board(STRAIGHT).astype(np.float32)
    columns = np.arange(STRAIGHT.width)
    turned = np.where(EXPECTED, distance - 0.0012 * (columns - 52), distance).astype(np.float32)
    seen = classify(surfaces_of(turned), PREDICTED, STRAIGHT.fx)
    assert not seen.foreground.any()


def term_before(distance: np.ndarray) -> ObservedDepth:
    noise = GaussianPolynomial(((3e-3,),))
    term = DepthTerm("tof", sparse(STRAIGHT, MESH), MESH, noise, Bounds(0.05, 1.6, 4.6))
    return term.observe(depth_image(distance), Prediction(as_surface((MESH.vertices, MESH.normals))))


def moved(x: float) -> Surface:
    return as_surface((MESH.vertices + np.array([x, 0, 0]), MESH.normals))


def test_behind_an_occluder_no_motion_pays():
    """All but a patch in the middle is hidden: the sheet may slide; in full sight its rims would meet the wall."""
    distance = board(STRAIGHT)
    covered = distance.copy()
    covered[:, 27:112] = 0.85
    covered[25:47, 57:82] = distance[25:47, 57:82]
    slides = [moved(0.0), moved(0.03), moved(-0.03)]
    costs = np.array([[term_before(image).cost(slide)[0] for slide in slides] for image in (covered, distance)])
    assert np.ptp(costs[0]) < 5
    assert np.ptp(costs[1]) > 20
    fit = term_before(covered).fit(slides[0])
    assert fit.occluded > 0.6 * len(MESH.vertices)
    assert fit.inliers >= 0.9 * fit.visible


def test_free_space_pushes_back_the_more_the_farther():
    term = term_before(board(STRAIGHT))
    steps = [float(term.cost(moved(x))[0]) for x in (0.0, 0.03, 0.06, 0.1)]
    growth = np.diff(steps)
    assert (growth > 0).all()
    assert growth[1] / 0.03 > growth[0] / 0.03
    assert growth[2] / 0.04 > growth[1] / 0.03


@pytest.mark.parametrize("x", [-0.06, 0.04])
def test_the_search_is_told_the_way_back_from_free_space(x):
    """The slope of what is linearised is that of the cost; depth itself says nothing about sliding along a plane."""
    term, model = term_before(board(STRAIGHT)), Rigid(MESH)
    theta = np.array([0, 0, 0, x, 0, 0])
    sparse_jacobian = model.sparse_jacobian(theta)
    linear = stack(term.linearize(model.deform(theta[None]), sparse_jacobian), 6)
    ahead, behind = (
        np.mean([term.cost(moved(x + sign * step))[0] for step in np.linspace(0.008, 0.02, 9)]) for sign in (1, -1)
    )
    steps = np.count_nonzero(np.abs(MESH.vertices[:, 0] + x) > 0.15)
    slope = linear.jacobian[:, 3] @ linear.residual
    assert steps > 0
    assert slope * x > 0
    assert slope == pytest.approx(np.sign(x) * steps / FREE_SCALE_M, rel=0.25)
    assert (ahead - behind) / 0.028 * np.sign(x) > abs(slope)  # and more vertices leave the object
    within = as_surface((MESH.vertices * (0.9, 0.9, 1), MESH.normals))
    assert stack(term.linearize(within, sparse_jacobian), 6).residual.size == term.fit(within).samples


def test_missing_returns_of_an_object_that_fills_the_image_are_holes():
    distance = np.full((48, 64), 1.0, np.float32)
    distance[10:14, 20:30] = np.nan
    seen = classify(surfaces_of(distance), np.full((48, 64), 1.0, np.float32), 150.0)
    assert np.array_equal(seen.hole, np.isnan(distance))


@given(st.integers(0, 2**32 - 1))
def test_distances_are_kept_in_free_space_alone(seed):
    generator, focal = np.random.default_rng(seed), np.float32(528)
    free, near = generator.random((4, 6)) < 0.5, generator.uniform(0.5, 2, (4, 6)).astype(np.float32)
    away = generator.uniform(0, 50, (4, 6)).astype(np.float32)
    expected = np.where(free, away * near / focal, 0)
    keep_free(free, near, focal, away)
    np.testing.assert_allclose(away, expected, rtol=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_missing_returns_are_background_if_their_area_shares_enough_pixels_with_that_of_the_first_image(seed):
    generator = np.random.default_rng(seed)
    first, later = generator.random((2, 12, 14)) < generator.uniform(0.3, 0.9)
    expected, background = np.zeros_like(first), Background()
    background.observe(first, expected, WHOLE, first.shape)
    labels = np.asarray(cv2.connectedComponents(later.view(np.uint8), connectivity=4)[1], np.intp)
    shared = np.bincount(labels[first & later], minlength=labels.max() + 1)
    areas = later & (shared >= MIN_PIXELS)[labels]
    np.testing.assert_array_equal(background.observe(later, expected, WHOLE, first.shape)[0], areas)


def test_an_area_is_lost_if_the_background_had_returns_in_it_far_from_the_object():
    """The first image shows a wall, and a shadow around the sheet."""
    first = np.zeros(EXPECTED.shape, np.bool_)
    first[2:70, 24:115] = ~EXPECTED[2:70, 24:115]
    background = Background()
    assert not background.observe(first, EXPECTED, WHOLE, first.shape)[1].any()
    later = first.copy()
    later[20:45, 2:45] = True  # of the wall, the shadow, and the sheet
    empty, lost = background.observe(later, EXPECTED, WHOLE, first.shape)
    assert empty[20:45, 2:45].all()
    assert np.array_equal(lost, later)
    assert not background.observe(np.zeros_like(first), EXPECTED, WHOLE, first.shape)[1].any()

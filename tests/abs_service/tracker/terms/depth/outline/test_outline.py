"""The rim of a sheet belongs on the outline that a depth sensor sees."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from abs_service.tracker.measurements import measurement
from abs_service.tracker.measurements.base import Comparison
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.synthesis.projection import Optics
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.classification.outline_distance import inwards
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.outline.rim import Edges, Rim, look_up, read
from abs_service.tracker.terms.depth.outline.rim_cost import MAX_DEVIATIONS, rim_cost
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from calib.noise.constant import Constant
from calib.rig import Sensor
from tests import reference
from tests.abs_service.tracker.scenes import depth_image, sparse
from tests.abs_service.tracker.terms.depth.outline.outline_scene import (
    CAMERA,
    MESH,
    begun,
    look,
    moved,
    outline,
    picture,
)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_places_read_their_pixel_of_a_part_of_an_image(seed: int):
    generator = np.random.default_rng(seed)
    image = generator.normal(size=(12, 15)).astype(np.float32)
    (top, left), places = generator.integers(0, 5, 2), generator.uniform(-2, 17, (40, 2))
    places[generator.random(40) < 0.1] = np.nan
    part = image[top : top + 6, left : left + 7]
    values = read(part, np.array([left, top], np.float32), places, (15, 12))
    for (u, v), value in zip(places, values, strict=True):
        row, column = np.floor(v + 0.5), np.floor(u + 0.5)
        if not (0 <= u < 15 and 0 <= v < 12):
            assert np.isnan(value)
        elif top <= row < top + 6 and left <= column < left + 7:
            assert value == image[int(row), int(column)]
        else:
            assert value == -np.inf


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_look_up_is_bilinear_interpolation(seed: int):
    generator = np.random.default_rng(seed)
    image = generator.normal(size=(7, 9)).astype(np.float32)
    image[generator.random(image.shape) < 0.05] = np.nan
    places = generator.uniform(-1, 10, (40, 2))
    values, gradients = np.empty(40), np.empty((40, 2))
    look_up(image, places, values, gradients)
    inside = np.all((places >= 0) & (places < (8, 6)), axis=1)
    expected = map_coordinates(image.astype(float), places[:, ::-1].T, order=1, cval=np.nan)
    known = inside & np.isfinite(expected)
    np.testing.assert_allclose(values[known], expected[known], atol=1e-5)
    assert np.all(values[~inside] > 1e8)
    assert not gradients[~inside].any()
    # Within a cell, the value changes as the gradients say where the other coordinate stays.
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = 1e-4
        there, ignored = np.empty(40), np.empty((40, 2))
        look_up(image, places + step, there, ignored)
        same = known & np.all(np.floor(places) == np.floor(places + step), axis=1)
        np.testing.assert_allclose((there - values)[same] / 1e-4, gradients[same, axis], atol=1e-4)


@pytest.mark.parametrize("lens", [Lens(), Lens(np.array([-0.2, 0.05])), KannalaBrandt(np.array([0.05, -0.01]))])
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_cost_of_the_rim_is_that_of_its_bounded_distances(lens: Lens, seed: int):
    """Everywhere in and beside the image, at unknown distances, and behind the camera."""
    generator, camera = np.random.default_rng(seed), replace(CAMERA, lens=lens)
    vertices = generator.uniform((-0.3, -0.25, 0.8), (0.3, 0.25, 1.2), (2, 60, 3)).astype(np.float32)
    vertices[:, ::9, 2] -= 2
    outer, inner = np.arange(0, 60, 2), np.arange(1, 60, 2)
    beyond = generator.uniform(0, 0.1, 30).astype(np.float32)
    inwards = generator.normal(0, 2, (70, 90)).astype(np.float32)
    inwards[generator.random(inwards.shape) < 0.05] = np.nan
    corner = np.array([17, 9], np.float32)
    ends = vertices[:, outer] + beyond[:, None] * (vertices[:, outer] - vertices[:, inner])
    places = np.array([[reference.project(camera, point) for point in member] for member in ends.astype(float)])
    undecided = np.any(np.abs(places - np.round(places)) < 1e-3, axis=(0, 2))  # single precision may decide otherwise
    rim = outer[~undecided], inner[~undecided], beyond[~undecided]
    expected = [
        reference.rim_cost(camera, member.astype(float), *rim, corner, inwards, 0.5, MAX_DEVIATIONS)
        for member in vertices
    ]
    costs, population = np.empty(2), np.ascontiguousarray(vertices.transpose(0, 2, 1))
    rim_cost(lens)(population, Edges(*rim), Optics.of(camera), inwards, corner, 0.5, costs)
    np.testing.assert_allclose(costs, expected, rtol=1e-4)


def test_a_rim_beside_an_image_part_of_one_row_is_far_away():
    rim, costs = Edges(np.array([0]), np.array([1]), np.zeros(1, np.float32)), np.empty(3)
    row = np.zeros((1, 5), np.float32), np.zeros(2, np.float32)
    rim_cost(CAMERA.lens)(np.ones((3, 3, 2), np.float32), rim, Optics.of(CAMERA), *row, 0.5, costs)
    assert costs.tolist() == [0.5 * MAX_DEVIATIONS**2] * 3


def test_the_outline_is_zero_and_distances_grow_inwards():
    distance = picture()
    view = sparse(CAMERA, MESH).view("tof", np.zeros((len(MESH.vertices), 0), np.float32))
    part, away = inwards(
        distance, classify(surfaces_of(distance), view.render(moved(MESH, 0.0)), CAMERA.fx), CAMERA.width
    )
    assert distance[part].shape == distance.shape
    row, on = CAMERA.height // 2, distance[CAMERA.height // 2] < 1.3
    assert np.all(away[row, on] > 0)
    assert np.all(away[row, ~on] < 0)
    first = int(np.argmax(on))
    np.testing.assert_allclose(away[row, first - 2 : first + 3], [-1.5, -0.5, 0.5, 1.5, 2.5])


def test_a_sheet_that_slid_along_itself_is_drawn_back():
    """Distances do not tell; the outline does, to the right and to the left, to a fraction of a pixel (5 mm)."""
    term, model = outline(picture()), Rigid(MESH)
    for x, y in ((6e-3, 0.0), (-6e-3, 4e-3)):
        theta = np.array([0, 0, 0, x, y, 0])
        assert term.cost(model.deform(theta[None]))[0] > term.cost(model.deform(np.zeros((1, 6))))[0] + 10
        linear = term.linearize(model.deform(theta[None]), model.sparse_jacobian(theta))
        step = np.linalg.lstsq(linear.jacobian[:, 3:5], -linear.residual, rcond=None)[0]
        np.testing.assert_allclose(theta[3:5] + step, 0, atol=1.5e-3)


def test_edges_that_disagree_with_the_outline_share_a_larger_error():
    """One side of the image moves against the mesh by 2 px: its shared error is as large as the misfit."""
    term, model = outline(picture()), Rigid(MESH)
    at_rest, slid = (
        term.linearize(model.deform(theta[None]), model.sparse_jacobian(theta))
        for theta in (np.zeros(6), np.array([0, 0, 0, 0.01, 0, 0]))
    )
    assert np.mean(at_rest.residual**2) < 1
    along_x, along_y = 3, 4
    right, left = (
        slid.shared()[0, along_x] / at_rest.shared()[0, along_x],
        slid.shared()[2, along_x] / at_rest.shared()[2, along_x],
    )
    np.testing.assert_allclose((right, left), 2 / 0.5, rtol=0.2)
    np.testing.assert_allclose(slid.shared()[[1, 3], along_y], at_rest.shared()[[1, 3], along_y], rtol=0.05)


def test_rows_predict_what_residuals_do():
    term, model = outline(picture()), Rigid(MESH)
    theta = np.array([0.01, -0.02, 0.03, 2e-3, 1e-3, 4e-3])
    linear = term.linearize(model.deform(theta[None]), model.sparse_jacobian(theta))
    for step in np.diag([1e-3, 1e-3, 1e-3, 2e-4, 2e-4, 1e-3]):
        ahead, behind = (
            term.linearize(model.deform((theta + part)[None]), model.sparse_jacobian(theta)).residual
            for part in (step, -step)
        )
        error = (ahead - behind) / 2 - linear.jacobian @ step
        # The rows are across the rim of the mesh, which theta turns by 0.03 away from the outline.
        assert np.median(np.abs(error)) < 0.03 * np.abs(linear.jacobian @ step).max()


def test_a_mesh_that_ends_inside_the_object_is_continued():
    """Its rim stays as far inside the outline as it was when it was made."""
    small = replace(MESH, vertices=MESH.vertices * (0.92, 0.92, 1.0))
    known = begun(picture(), small)
    assert look(known, picture(), small).cost(moved(small, 0.0))[0] < 1
    term = look(known, picture(by=0.01), small)
    costs = [term.cost(moved(small, x))[0] for x in (0.0, 5e-3, 10e-3, 15e-3, 20e-3)]
    assert np.argmin(costs) == 2


def test_the_outline_of_a_frame_stays_as_it_was_observed():
    known, model = begun(picture()), Rigid(MESH)
    first, theta = look(known, picture()), np.array([0, 0, 0, 6e-3, 0, 0])
    surface, sparse_jacobian = model.deform(theta[None]), model.sparse_jacobian(theta)
    cost, residual = first.cost(surface), first.linearize(surface, sparse_jacobian).residual
    fit = first.fit(surface)
    assert look(known, picture(by=0.01)).cost(surface) < cost
    assert first.cost(surface) == cost
    np.testing.assert_array_equal(first.linearize(surface, sparse_jacobian).residual, residual)
    assert first.fit(surface) == fit


def test_what_hides_the_rim_says_nothing_about_it():
    """A hand before one end, or no returns from there: only the other three sides have an outline."""
    hand, hole = picture(), picture()
    columns = slice(70, 120)
    hand[:, columns] = 0.7
    hole[:, columns] = np.nan
    for distance in (hand, hole):
        linear = outline(distance).linearize(
            moved(MESH, 0.0), SparseJacobian.from_dense(np.zeros((len(MESH.vertices), 3, 1)))
        )
        x = CAMERA.project(MESH.vertices[Rim.of(MESH).outer])[:, 0]
        assert len(linear.residual) < np.count_nonzero(x < 70) + 3
        assert len(linear.residual) > 0.8 * np.count_nonzero(x < 70)


@pytest.mark.parametrize("outline_px", [0.0, 0.5])
def test_free_space_right_beside_the_outline_is_held_against_no_vertex(outline_px: float):
    """The rim is where one pixel shows the sheet and the next one the wall: half of its vertices meet the wall."""
    sensor = Sensor("tof", CAMERA, Constant(5e-3))
    comparison = Comparison(Bounds(0.05, 1.6, 4.6), outline_px=outline_px)
    term = measurement(sensor.noise).term(sensor, MESH, sparse(CAMERA, MESH), comparison)
    term = term.observe(depth_image(picture(by=-2e-3)), Prediction(moved(MESH, 0.0)))
    fit = term.fit(moved(MESH, 0.0))
    assert (fit.inliers == fit.visible) == (outline_px > 0)
    assert fit.occluded == 0


def test_the_likelihood_has_it_by_a_key():
    assert likelihood.Settings().outline_px == "auto"
    assert likelihood.Settings(outline_px=0.5).outline_px == 0.5


def test_distances_near_the_outline_do_not_depend_on_how_far_the_image_goes_on():
    distance = picture()
    distance[20:24, 30:60] = np.nan
    view = sparse(CAMERA, MESH).view("tof", np.zeros((len(MESH.vertices), 0), np.float32))
    seen = classify(surfaces_of(distance), view.render(moved(MESH, 0.0)), CAMERA.fx)
    _, everywhere = inwards(distance, seen, CAMERA.width)
    part, near = inwards(distance, seen, 3)
    assert near.size < 0.8 * everywhere.size
    np.testing.assert_array_equal(near, everywhere[part])
    beyond = everywhere.copy()
    beyond[part] = -3
    assert np.nanmax(beyond) <= -3

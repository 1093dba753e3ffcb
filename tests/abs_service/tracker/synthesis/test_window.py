"""Window around the prediction, which alone is prepared: costs within reach are unchanged, others are outliers."""

from dataclasses import asdict
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage, Window
from abs_service.tracker.models.base import Surface
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.settings import Settings
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.window import WHOLE, Bordered, Placed, around
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, Prediction
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.noise.per_pixel import PerPixel
from calib.noise.texture import write_texture
from tests.abs_service.tracker.scenes import (
    CAMERA,
    FISHEYE,
    as_surface,
    depth_image,
    flat,
    plane_distance,
    sheet,
    sparse,
)
from tests.calib.noise.texels import render_texture

WIDE = Camera(200, 120, 220.0, 220.0, 99.5, 59.5)
MESH = sheet(height=flat)
NOISE = GaussianPolynomial(((3e-3,),))
BOUNDS = Bounds(0.05, 1.6, 4.6)
REACH_M = 0.05
seeds = st.integers(0, 2**32 - 1)


def moved(*by: float) -> Surface:
    return as_surface((MESH.vertices + np.array(by), MESH.normals))


def scene(x: float = 0.0) -> np.ndarray:
    """Distances of a sheet with a hole in front of a wall, with a finger in front of the sheet."""
    mesh = (MESH.vertices + np.array([x, 0, 0])).T.astype(np.float32)
    distance = Raster(WIDE, MESH.faces).render(mesh)
    wall = plane_distance(WIDE, np.array([0, 0, 1.0]), 1.6)
    picture = np.where(np.isfinite(distance), distance, wall)
    picture[30:62, 80:86] = 0.85
    picture[66:74, 100:112] = np.nan
    return picture


def depth_term(outline: bool = False) -> DepthTerm:
    term = partial(DepthTerm, "tof", sparse(WIDE, MESH), MESH, NOISE, BOUNDS)
    return term(outline=lambda camera: RimOutline(camera, Rim.of(MESH), 0.5)) if outline else term()


@pytest.mark.parametrize("down", [0.4, -0.4, 3.0])
def test_a_surface_beside_the_image_has_a_window_and_a_cost(down):
    away = moved(0, down, 0)
    window = around(WIDE, Projection(WIDE), away, 0.0)
    assert scene()[window].size > 0
    term = depth_term(outline=True)
    term.observe(depth_image(scene()), Prediction(moved(0, 0, 0), REACH_M))
    assert np.isfinite(term.observe(depth_image(scene()), Prediction(away, 0.0)).cost(away)).all()


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from([CAMERA, FISHEYE, WIDE]), st.floats(0, 0.2))
def test_a_window_holds_all_that_is_within_reach(seed, camera, reach):
    generator = np.random.default_rng(seed)
    rows, columns = around(camera, Projection(camera), moved(0, 0, 0), reach)
    steps = generator.normal(size=(len(MESH.vertices), 3))
    steps *= reach * generator.random((len(steps), 1)) / np.linalg.norm(steps, axis=1, keepdims=True)
    place = np.floor(camera.project(MESH.vertices + steps) + 0.5)
    seen = np.all((place >= 0) & (place < (camera.width, camera.height)), axis=1)
    assert (place[seen] >= (columns.start, rows.start)).all()
    assert (place[seen] < (columns.stop, rows.stop)).all()


def test_without_bounds_or_partly_out_of_sight_the_window_is_the_whole_image():
    assert around(WIDE, Projection(WIDE), moved(0, 0, 0), np.inf) == WHOLE
    assert around(WIDE, Projection(WIDE), moved(0, 0, -1.05), 0.01) == WHOLE
    assert around(WIDE, Projection(WIDE), moved(0.4, 0, 0), 0.01) == WHOLE


@pytest.mark.parametrize("outline", [False, True])
def test_within_reach_depth_costs_the_same_as_in_the_whole_image(outline):
    terms = depth_term(outline), depth_term(outline)
    for x in (0.0, 0.02, -0.03):  # memory reused between frames must have no effect
        predicted = moved(x + 0.004, 0.002, 0)
        image = depth_image(scene(x))
        whole, window = (term.observe(image, Prediction(predicted, by)) for term, by in zip(terms, (np.inf, REACH_M)))
        for step in np.random.default_rng(1).uniform(-0.02, 0.02, (20, 3)):
            surface = moved(x + step[0], step[1], 0.3 * step[2])
            np.testing.assert_array_equal(window.cost(surface), whole.cost(surface))
            np.testing.assert_equal(asdict(window.fit(surface)), asdict(whole.fit(surface)))  # NaN is NaN
        np.testing.assert_array_equal(window.occluders, whole.occluders)


def test_within_reach_colours_cost_the_same_as_in_the_whole_image():
    terms = [ColorTerm("color", sparse(WIDE, MESH), MESH.colors, GaussianColor(), BOUNDS) for _ in range(2)]
    occluder = np.array([[0.0, 0.0, 0.9], [1.0, 0.0, 0.9]])  # one on the sheet, one outside the window
    for seed, x in enumerate((0.0, 0.03)):
        picture = ColorImage(np.random.default_rng(seed).integers(0, 255, (120, 200, 3)).astype(np.uint8))
        for hidden_by in (NO_OCCLUDERS, occluder):
            seen = [
                term.observe(picture, Prediction(moved(x, 0, 0), reach, hidden_by))
                for term, reach in zip(terms, (np.inf, REACH_M))
            ]
            for step in np.random.default_rng(1).uniform(-0.02, 0.02, (20, 3)):
                surface = moved(x + step[0], step[1], 0.3 * step[2])
                np.testing.assert_array_equal(seen[1].cost(surface), seen[0].cost(surface))


@pytest.mark.parametrize("order", ["rggb", "gbrg"])
def test_within_reach_a_mosaic_costs_the_same_as_in_the_whole_image(order):
    """The window may start at any pixel of the Bayer pattern."""
    noise, pattern = GaussianBayer(60.0), BAYER_ORDERS[order]
    terms = [ChannelTerm("color", sparse(WIDE, MESH), MESH.colors, noise, Passive(), BOUNDS) for _ in range(2)]
    occluder = np.array([[0.0, 0.0, 0.9], [1.0, 0.0, 0.9]])
    for seed, x in enumerate((0.0, 0.03, 0.0341)):
        values = np.random.default_rng(seed).uniform(0, 255, (120, 200)).astype(np.float32)
        image, predicted = ChannelImage(values, pattern), moved(x, 0, 0)
        for hidden_by in (NO_OCCLUDERS, occluder):
            whole, window = (
                term.observe(image, Prediction(predicted, by, hidden_by)) for term, by in zip(terms, (np.inf, REACH_M))
            )
            for step in np.random.default_rng(1).uniform(-0.02, 0.02, (20, 3)):
                surface = moved(x + step[0], step[1], 0.3 * step[2])
                np.testing.assert_array_equal(window.cost(surface), whole.cost(surface))
                found, wanted = window.fit(surface), whole.fit(surface)
                assert (found.visible, found.occluded, found.inliers) == (
                    wanted.visible,
                    wanted.occluded,
                    wanted.inliers,
                )


def test_beyond_the_window_nothing_is_explained():
    """Otherwise a search could escape from a bad fit into unprepared pixels."""
    depth = depth_term()
    depth.observe(depth_image(scene()), Prediction(moved(0, 0, 0)))  # the first image is seen as a whole
    seen = depth.observe(depth_image(scene(0.2)), Prediction(moved(-0.15, 0, 0), 0.01))
    assert seen.cost(moved(0.25, 0, 0))[0] == pytest.approx(len(MESH.vertices) * BOUNDS.outlier, rel=1e-5)
    color = ColorTerm("color", sparse(WIDE, MESH), MESH.colors, GaussianColor(), BOUNDS)
    color = color.observe(ColorImage(np.full((120, 200, 3), 90, np.uint8)), Prediction(moved(-0.15, 0, 0), 0.01))
    assert color.cost(moved(0.25, 0, 0))[0] == pytest.approx(len(MESH.vertices) * BOUNDS.outlier, rel=1e-5)
    bayer = ChannelTerm("color", sparse(WIDE, MESH), MESH.colors, GaussianBayer(), Passive(), BOUNDS)
    bayer = bayer.observe(
        ChannelImage(np.full((120, 200), 90, np.float32), BAYER_ORDERS["rggb"]), Prediction(moved(-0.15, 0, 0), 0.01)
    )
    assert bayer.cost(moved(0.25, 0, 0))[0] == pytest.approx(len(MESH.vertices) * BOUNDS.outlier, rel=1e-5)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_a_part_of_a_texture_is_that_part_of_the_whole_one(seed):
    generator = np.random.default_rng(seed)
    distance = generator.uniform(0.5, 2, (9, 14)).astype(np.float32)
    distance[generator.random(distance.shape) < 0.2] = np.nan
    offset, factor = generator.uniform(-0.01, 0.01, (1, *distance.shape)), generator.uniform(0.5, 2, distance.shape)
    noise = PerPixel(NOISE, offset, factor, np.array([0.5, 2.0]))
    whole = render_texture(noise, distance, distance, 1.6)
    (top, bottom), (left, right) = (np.sort(generator.integers(0, size + 1, 2)) for size in distance.shape)
    window = slice(top, bottom), slice(left, right)
    part = render_texture(noise, np.full_like(distance, np.nan), distance, 1.6)
    write_texture(noise, distance[window], distance[window], (top, left), part)
    np.testing.assert_array_equal(part[1:-1, 1:-1][window], whole[1:-1, 1:-1][window])
    outside = np.ones(part.shape[:2], np.bool_)
    outside[1:-1, 1:-1][window] = False
    assert (part[outside, 6] == np.float32(1.6)).all()


def test_a_bordered_image_is_cleaned_where_the_last_window_was():
    image = Bordered(np.array([1.0, 2.0], np.float32), np.array([3.0, 4.0], np.float32))
    first = image.begin((4, 6), (slice(0, 2), slice(1, 3)))
    first[1:-1, 1:-1][:2, 1:3] = 9
    second = image.begin((4, 6), (slice(2, 4), slice(4, 6)))
    assert second is first
    expected = np.full((6, 8, 2), (1.0, 2.0))
    expected[1:-1, 1:-1] = (3.0, 4.0)
    expected[3:5, 5:7] = (1.0, 2.0)
    np.testing.assert_array_equal(second, expected)
    assert image.begin((5, 6), WHOLE).shape == (7, 8, 2)


@st.composite
def parts(draw: st.DrawFn, height: int = 6, width: int = 7) -> Window:
    rows, columns = (sorted((draw(st.integers(0, size)), draw(st.integers(0, size)))) for size in (height, width))
    return slice(*rows), slice(*columns)


@given(st.lists(parts(), min_size=1, max_size=5))
def test_windows_that_move_leave_nothing_behind(windows):
    image, placed = Bordered(np.array([1.0], np.float32), np.array([3.0], np.float32)), Placed(np.int64)
    for number, window in enumerate(windows, 1):
        seen = image.begin((6, 7), window)
        expected = np.full((6, 7), 3.0)
        expected[window] = 1
        np.testing.assert_array_equal(seen[1:-1, 1:-1, 0], expected)
        assert (seen[0] == 1).all()
        seen[1:-1, 1:-1][window] = 9
        values = np.zeros((6, 7), np.int64)
        values[window] = number
        np.testing.assert_array_equal(placed.put(window, values[window], 6, 7), np.pad(values, 1))
    assert placed.put(WHOLE, np.ones((2, 3), np.int64), 2, 3).sum() == 6


@given(st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 2, st.floats(-0.3, 1.5)), min_size=2, max_size=4))
def test_a_mesh_that_moves_leaves_no_picture_behind(shifts):
    raster = Raster(WIDE, MESH.faces)
    for shift in shifts:
        vertices = (MESH.vertices + shift).T.astype(np.float32)
        alone = Raster(WIDE, MESH.faces).render(vertices)
        np.testing.assert_array_equal(raster.render(vertices), alone)
        beside = np.isinf(alone)
        assert not np.isnan(alone).any()
        assert (alone[~beside] > 0).all()


def test_the_motion_prior_reaches_as_far_as_its_deviation_allows():
    prior = MotionPrior(np.zeros(3), ChangeMetric(np.ones(3), np.zeros((0, 3))), Settings(speed=0.3))
    first = prior.predict(0)
    assert np.isinf(first.reach_m)  # no motion is known in the first frame
    prior.update(first, np.zeros(3), np.zeros((3, 3)))
    second = prior.predict(100_000_000)
    assert second.reach_m == pytest.approx(4 * 0.3 * 0.1)
    assert second.cost(np.array([[second.reach_m, 0, 0]]))[0] == pytest.approx(8)

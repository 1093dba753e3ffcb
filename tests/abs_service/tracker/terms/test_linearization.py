"""Residuals and their derivatives are those of the cost, on surfaces that are smooth enough for derivatives."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.models.nurbs import Settings
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.settings import Settings as PriorSettings
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.synthesis.sparse import Sparse
from abs_service.tracker.terms.base import Bounds, Term
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.gradients import color_rows, depth_rows
from abs_service.tracker.terms.linearization import Linearization, PointLinearization, stack
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.rig import Noise, Rig, Sensor
from tests.abs_service.tracker.scenes import as_surface, depth_image, flat, observation, plane_distance, sheet, sparse

#: Many fine pixels, so that rounding to one of them is small against the steps of the derivatives.
FINE = Camera(640, 480, 1500.0, 1500.0, 319.5, 239.5)
#: A camera whose columns and rows fit into the levels of a colour.
COLOR = Camera(250, 200, 560.0, 560.0, 124.5, 99.5)
MESH = sheet(height=lambda x, y: 1.0 + 0.2 * x - 0.1 * y)
NORMAL = np.array([-0.2, 0.1, 1.0])
SIGMA = 5e-3
BOUNDS = Bounds(0.05, 1.6, 4.6)
LIKELIHOOD = likelihood.Settings()


def depth_term() -> DepthTerm:
    term = DepthTerm("tof", sparse(FINE, MESH), len(MESH.vertices), GaussianPolynomial(((SIGMA,),)), BOUNDS)
    term.observe(depth_image(plane_distance(FINE, NORMAL, 1.0)), as_surface((MESH.vertices, MESH.normals)))
    return term


def central_difference(term: Term, model: Rigid, theta: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Half of the change of all residuals between two steps in opposite directions."""
    ends = [
        term.linearize(model.deform((theta + part)[None]), model.sparse_jacobian(theta)).residual
        for part in (step, -step)
    ]
    return (ends[0] - ends[1]) / 2


def test_depth_rows_predict_what_the_plane_s_residuals_do():
    """The derivative is exact for a plane that is parallel to the mesh: a vertex takes its pixel along."""
    model, term = Rigid(MESH), depth_term()
    theta = np.array([0, 0, 0, 2e-3, -1e-3, 3e-3])
    there = model.deform(theta[None])
    linear = term.linearize(there, model.sparse_jacobian(theta))
    assert len(linear.residual) == len(MESH.vertices)
    for step in np.diag([0.02, 0.02, 0.1, 0.02, 0.04, 5e-3]):
        predicted = linear.jacobian @ step
        actual = central_difference(term, model, theta, step)
        np.testing.assert_allclose(actual, predicted, atol=0.1)  # pixels are 0.7 mm wide
        assert np.abs(predicted).max() > 0.4


def test_depth_residuals_are_normalised_differences():
    model, term = Rigid(MESH), depth_term()
    nearer = np.array([0, 0, 0, 0, 0, -SIGMA])
    linear = term.linearize(model.deform(nearer[None]), model.sparse_jacobian(nearer))
    sight = MESH.vertices / np.linalg.norm(MESH.vertices, axis=1, keepdims=True)
    gap = SIGMA * NORMAL[2] / (sight @ NORMAL)  # along the ray, from a plane moved by σ along z
    np.testing.assert_allclose(linear.residual, gap / SIGMA, atol=0.04)
    np.testing.assert_allclose(linear.jacobian[:, 5], -gap / SIGMA**2, rtol=0.02)


@given(st.integers(0, 2**32 - 1), st.integers(0, 20))
def test_the_chain_rule_is_a_product_of_matrices(seed, count):
    generator = np.random.default_rng(seed)
    group = np.sort(generator.integers(0, 3, 9)).astype(np.int32)
    parameters = np.stack([generator.permutation(7)[:4] for _ in range(3)])
    sparse_jacobian = SparseJacobian(generator.standard_normal((9, 3, 4)), group, parameters, 7)
    points, rows = generator.integers(0, 9, count), generator.standard_normal((count, 3))
    expected = np.einsum("mi,mid->md", rows, sparse_jacobian.dense[points])
    positions = generator.standard_normal((9, 3))
    linear = PointLinearization(generator.standard_normal(count), rows, points, sparse_jacobian, positions)
    np.testing.assert_allclose(linear.jacobian, expected, rtol=0, atol=1e-12)
    parts, order = stack(linear.parts(), 7), np.argsort(group[points], kind="stable")
    np.testing.assert_array_equal(parts.residual, linear.residual[order])
    np.testing.assert_allclose(parts.jacobian, expected[order], rtol=0, atol=1e-12)
    placed = np.concatenate([np.zeros((0, 3)), *(part.positions for part in linear.parts())])
    np.testing.assert_array_equal(placed, positions[points][order])


def test_grazing_views_do_not_explode():
    normals = np.array([[0.0, 0, -1], [1, 0, -1e-4]]) / [[1], [np.hypot(1, 1e-4)]]
    rows = depth_rows(np.array([[0.0, 0, 1], [0, 0, 1]]), normals, np.zeros(3), np.arange(2), np.ones(2))
    np.testing.assert_allclose(rows[0], [0, 0, -1])
    assert np.linalg.norm(rows[1]) == pytest.approx(5)


def ramp() -> np.ndarray:
    """Colours that change by one level per pixel: red to the right, green downwards, blue upwards."""
    columns, rows = np.meshgrid(np.arange(COLOR.width), np.arange(COLOR.height))
    return np.stack([columns, rows, 255 - rows], axis=-1).astype(np.uint8)


def seen_by(noise: Noise) -> Sensor:
    return Sensor("any", COLOR, noise)


def test_color_rows_predict_what_a_ramp_s_residuals_do():
    mesh = sheet(7, 9, height=flat, size=(0.2, 0.14))
    model = Rigid(mesh)
    columns, rows = np.floor(COLOR.project(mesh.vertices) + 0.5).T  # as measured: the exposure has not changed
    colors = np.stack([columns, rows, 255 - rows], axis=-1)
    noise = GaussianColor(10.0)
    bounds = LIKELIHOOD.bounds(seen_by(noise))
    term = ColorTerm("color", sparse(COLOR, mesh), colors.astype(np.float32), noise, bounds)
    term.observe(ColorImage(ramp()), as_surface((mesh.vertices, mesh.normals)))
    linear = term.linearize(model.deform(model.rest[None]), model.sparse_jacobian(model.rest))
    np.testing.assert_allclose(linear.residual, 0, atol=1e-6)
    for parameter, step in [(3, 0.02), (4, -0.02), (5, 0.1), (2, 0.15)]:
        theta = np.zeros(6)
        theta[parameter] = step
        predicted = linear.jacobian[:, parameter] * step
        np.testing.assert_allclose(central_difference(term, model, model.rest, theta), predicted, atol=0.11)
        assert np.abs(predicted).max() > 0.4


@given(st.integers(0, 2**32 - 1))
def test_color_rows_are_a_regression_on_the_neighbourhood(seed):
    """At the rim the last pixel goes on, and where nothing is known the pixel's own colour does."""
    generator = np.random.default_rng(seed)
    camera = Camera(12, 9, 30.0, 32.0, 5.5, 4.0)
    image = generator.uniform(0, 255, (9, 12, 3)).astype(np.float32)
    vertices = generator.uniform(-0.15, 0.15, (20, 3)) * [1, 0.7, 1] + [0, 0, 1]
    column, row = np.floor(camera.project(vertices) + 0.5).astype(int).clip(0, [11, 8]).T
    unknown = generator.random((9, 12)) < 0.2
    unknown[row, column] = False
    image[unknown] = np.nan
    steps = np.arange(-2, 3)
    weights = np.exp(-0.5 * (steps**2 + steps[:, None] ** 2))
    expected = np.zeros((20, 3, 2))
    for v in range(20):
        rows, columns = (row[v] + steps).clip(0, 8), (column[v] + steps).clip(0, 11)
        patch = image[rows][:, columns].astype(float)
        patch = np.where(np.isnan(patch), image[row[v], column[v]], patch)
        sums = [np.einsum("ij,ijc->c", weights * on, patch) for on in (steps, steps[:, None])]
        expected[v] = np.stack(sums, axis=-1) / np.sum(weights * steps**2)
    found = color_rows(image, camera, vertices)
    np.testing.assert_allclose(found, expected @ camera.projection_jacobian(vertices), rtol=0, atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(BAYER_ORDERS)))
def test_mosaic_rows_are_exact_within_a_pixel_whatever_the_picture(seed, order):
    generator = np.random.default_rng(seed)
    mesh = sheet(7, 9, height=lambda x, y: 1.0 + 0.1 * x, size=(0.2, 0.14))
    rig = Rig("r", {"bayer": Sensor("bayer", COLOR, GaussianBayer(50.0))})
    model, synthesizer = Rigid(mesh), Sparse(rig, mesh)
    looks = generator.uniform(100, 150, (len(synthesizer.canvas.vertices), 3)).astype(np.float32)
    noise = GaussianBayer(50.0)
    term = ChannelTerm("bayer", synthesizer, looks, noise, Passive(), LIKELIHOOD.bounds(seen_by(noise)))
    view = synthesizer.view("bayer", looks)
    picture = generator.uniform(100, 150, (COLOR.height, COLOR.width)).astype(np.float32)
    term.observe(ChannelImage(picture, BAYER_ORDERS[order]), model.deform(model.rest[None]))
    linear = term.linearize(model.deform(model.rest[None]), model.sparse_jacobian(model.rest))
    assert len(linear.residual) == len(mesh.vertices)
    for step in np.diag([1e-4, 1e-4, 1e-4, 2e-5, 2e-5, 1e-4]):
        there, back = (model.deform((model.rest + part)[None]) for part in (step, -step))
        stays = view.synthesize(there).pixel[0] == view.synthesize(back).pixel[0]
        actual = central_difference(term, model, model.rest, step)
        assert stays.mean() > 0.5
        np.testing.assert_allclose((linear.jacobian @ step)[stays], actual[stays], rtol=0.02, atol=2e-4)


@pytest.mark.parametrize("objective", [likelihood.Settings(), euclidean.Settings(cutoff_m=0.06, cutoff_levels=100.0)])
@pytest.mark.parametrize("deviations", [0.0, 2.9, 3.3, 3.7, 5.0, 7.0])
def test_what_costs_less_than_an_outlier_is_linearized_whatever_the_objective(objective, deviations):
    """Or a descent would ignore what its cost is made of: then it stops where that is not least."""
    noise, mesh = GaussianPolynomial(((0.01,),)), MESH
    distance = plane_distance(FINE, NORMAL, 1.0)
    rig = Rig("r", {"tof": Sensor("tof", FINE, noise)})
    found = objective.build(rig, mesh, sparse(FINE, mesh))
    found = found.observe(observation(0, (), tof=depth_image(distance)), as_surface((mesh.vertices, mesh.normals)))
    along = np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    nearer = as_surface((mesh.vertices * (1 - 0.01 * deviations / along), mesh.normals))
    costs = [
        float(found.cost(as_surface((mesh.vertices * (1 - (0.01 * deviations + by) / along), mesh.normals)))[0])
        for by in (-1e-4, 1e-4)
    ]
    (linear,) = found.linearize(nearer, SparseJacobian.from_dense((mesh.vertices / along)[:, :, None]))
    gradient = -(linear.jacobian.T @ linear.residual)[0]
    np.testing.assert_allclose((costs[1] - costs[0]) / 2e-4, gradient, rtol=0.02, atol=20.0)


def test_only_inliers_and_what_is_in_free_space_are_linearized():
    mesh = MESH
    distance = plane_distance(FINE, NORMAL, 1.0)
    surface = as_surface((mesh.vertices, mesh.normals))
    view = sparse(FINE, mesh).view("tof", np.zeros((len(mesh.vertices), 0), np.float32))
    around = cv2.dilate(np.isfinite(view.render(surface)).astype(np.uint8), np.ones((5, 5))) > 0
    distance[around & (np.arange(640) < 320)] = np.nan  # a hole in the object, not a background without return
    distance[:240] += 1
    term = DepthTerm("tof", sparse(FINE, mesh), len(mesh.vertices), GaussianPolynomial(((SIGMA,),)), BOUNDS)
    term.observe(depth_image(distance), surface)
    linear = term.linearize(surface, SparseJacobian.from_dense(np.zeros((len(mesh.vertices), 3, 2))))
    pixels = FINE.project(mesh.vertices) + 0.5
    inliers = np.count_nonzero((pixels[:, 0] >= 320) & (pixels[:, 1] >= 240))
    free = np.count_nonzero((pixels[:, 0] >= 320) & (pixels[:, 1] < 240))
    assert len(linear.residual) == inliers + free
    assert np.abs(linear.residual[:inliers]).max() < 0.2
    fit = term.fit(surface)
    assert fit.inliers == inliers
    assert fit.visible + fit.occluded == len(mesh.vertices)
    assert fit.occluded > 0.6 * np.count_nonzero(pixels[:, 0] < 320)  # the half without returns, but for its rim
    assert fit.samples == np.count_nonzero(pixels[:, 0] >= 320)
    assert fit.normalized_residual < 0.2


def test_stretch_rows_are_derivatives_of_the_stretch_cost():
    model = Settings(control_points=(4, 4)).of_mesh(sheet(5, 6))
    prior = StretchPrior(model.mesh, 0.02)
    theta = model.rest + np.random.default_rng(2).normal(0, 3e-3, len(model.rest))
    linear = stack(prior.linearize(model.deform(theta[None]), model.sparse_jacobian(theta)), len(theta))
    assert 0.5 * np.sum(linear.residual**2) == pytest.approx(prior.cost(model.deform(theta[None]))[0], rel=1e-3)
    gradient, h = linear.jacobian.T @ linear.residual, 1e-4
    offsets = h * np.eye(len(theta))
    costs = prior.cost(model.deform(np.concatenate([theta + offsets, theta - offsets])))
    numerical = (costs[: len(theta)] - costs[len(theta) :]) / (2 * h)
    np.testing.assert_allclose(gradient, numerical, atol=0.02 * np.abs(numerical).max())


def test_the_motion_cost_is_that_of_its_precision():
    motion = MotionPrior(
        np.array([1.0, 2.0]), ChangeMetric(np.array([1.0, 3.0]), np.array([[1.0, -2.0]])), PriorSettings(speed=0.3)
    )
    prior = motion.predict(0)
    for change in (np.zeros(2), np.array([0.02, 0.01]), np.array([0.03, -0.01])):
        expected = 0.5 * change @ prior.precision @ change
        assert prior.cost((prior.theta + change)[None])[0] == pytest.approx(expected)


def test_linearizations_are_stacked_also_if_there_is_none():
    assert stack([], 3).jacobian.shape == (0, 3)
    parts = [Linearization(np.ones(k), np.full((k, 3), k)) for k in (1, 2)]
    assert stack(parts, 3).jacobian.tolist() == [[1, 1, 1], [2, 2, 2], [2, 2, 2]]


def test_colours_are_read_alike_whatever_the_order_of_their_bytes():
    """A camera that delivers blue first: its image is a view with reversed channels."""
    mesh = sheet(7, 9, height=flat, size=(0.2, 0.14))
    model, theta, noise = Rigid(mesh), np.zeros(6), GaussianColor(10.0)
    columns, rows = COLOR.project(mesh.vertices).T
    colors, bounds = np.stack([columns, rows, 255 - rows], axis=-1), LIKELIHOOD.bounds(seen_by(noise))
    found = []
    for rgb in (ramp(), np.ascontiguousarray(ramp()[..., ::-1])[..., ::-1]):
        term = ColorTerm("color", sparse(COLOR, mesh), colors.astype(np.float32), noise, bounds)
        for _ in range(2):  # memory is reused
            term.observe(ColorImage(rgb), as_surface((mesh.vertices, mesh.normals)), 0.02)
        found.append(term.linearize(model.deform(theta[None]), model.sparse_jacobian(theta)))
    np.testing.assert_array_equal(found[0].residual, found[1].residual)
    np.testing.assert_array_equal(found[0].jacobian, found[1].jacobian)
    assert found[0].residual.size > mesh.vertices.size / 2

"""Residuals and derivatives of colours are those of their cost, on pictures that are smooth enough for derivatives."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.synthesis.sparse import Sparse
from abs_service.tracker.terms.base import Prediction
from abs_service.tracker.terms.gradients import color_rows
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from calib.camera import Camera
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.rig import Noise, Rig, Sensor
from tests.abs_service.tracker.scenes import as_surface, flat, sheet, sparse
from tests.abs_service.tracker.terms.residual_changes import central_difference

#: A camera whose columns and rows fit into the levels of a colour.
COLOR = Camera(250, 200, 560.0, 560.0, 124.5, 99.5)
LIKELIHOOD = likelihood.Settings()


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
    term = term.observe(ColorImage(ramp()), Prediction(as_surface((mesh.vertices, mesh.normals))))
    (linear,) = term.linearize(model.deform(model.rest[None]), model.sparse_jacobian(model.rest))
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
    """The picture is linear: what noise adds to the rows is taken away, see `test_gradient_noise`."""
    generator = np.random.default_rng(seed)
    mesh = sheet(7, 9, height=lambda x, y: 1.0 + 0.1 * x, size=(0.2, 0.14))
    rig = Rig("r", {"bayer": Sensor("bayer", COLOR, GaussianBayer(50.0))})
    model, synthesizer = Rigid(mesh), Sparse(rig, mesh)
    looks = generator.uniform(100, 150, (len(synthesizer.canvas.vertices), 3)).astype(np.float32)
    noise = GaussianBayer(50.0)
    term = ChannelTerm("bayer", synthesizer, looks, noise, Passive(), LIKELIHOOD.bounds(seen_by(noise)))
    view = synthesizer.view("bayer", looks).observe(model.deform(model.rest[None]))
    level, right, down = generator.uniform((100, -0.1, -0.1), (150, 0.1, 0.1))
    picture = level + right * np.arange(COLOR.width) + down * np.arange(COLOR.height)[:, None]
    term = term.observe(
        ChannelImage(picture.astype(np.float32), BAYER_ORDERS[order]), Prediction(model.deform(model.rest[None]))
    )
    (linear,) = term.linearize(model.deform(model.rest[None]), model.sparse_jacobian(model.rest))
    assert len(linear.residual) == len(mesh.vertices)
    for step in np.diag([1e-4, 1e-4, 1e-4, 2e-5, 2e-5, 1e-4]):
        there, back = (model.deform((model.rest + part)[None]) for part in (step, -step))
        stays = view.synthesize(there).pixel[0] == view.synthesize(back).pixel[0]
        actual = central_difference(term, model, model.rest, step)
        assert stays.mean() > 0.5
        np.testing.assert_allclose((linear.jacobian @ step)[stays], actual[stays], rtol=0.02, atol=2e-4)


def test_colours_are_read_alike_whatever_the_order_of_their_bytes():
    """A camera that delivers blue first: its image is a view with reversed channels."""
    mesh = sheet(7, 9, height=flat, size=(0.2, 0.14))
    model, theta, noise = Rigid(mesh), np.zeros(6), GaussianColor(10.0)
    columns, rows = COLOR.project(mesh.vertices).T
    colors, bounds = np.stack([columns, rows, 255 - rows], axis=-1), LIKELIHOOD.bounds(seen_by(noise))
    found = []
    for rgb in (ramp(), np.ascontiguousarray(ramp()[..., ::-1])[..., ::-1]):
        term = ColorTerm("color", sparse(COLOR, mesh), colors.astype(np.float32), noise, bounds)
        predicted = as_surface((mesh.vertices, mesh.normals))
        _, second = (term.observe(ColorImage(rgb), Prediction(predicted, 0.02)) for _ in range(2))  # memory is reused
        found += second.linearize(model.deform(theta[None]), model.sparse_jacobian(theta))
    np.testing.assert_array_equal(found[0].residual, found[1].residual)
    np.testing.assert_array_equal(found[0].jacobian, found[1].jacobian)
    assert found[0].residual.size > mesh.vertices.size / 2

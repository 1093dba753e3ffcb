"""Pictures of which nobody knows to a part of a pixel what lies where on the mesh."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage
from abs_service.tracker.models import rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.synthesis import dense
from abs_service.tracker.terms.base import Prediction
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_WIDENING,
    TextureRegistrationNoise,
    Widening,
)
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor
from tests import reference
from tests.abs_service.tracker.scenes import CAMERA, as_surface, in_sight, sheet, sparse
from tests.abs_service.tracker.synthesis.random_vertices import decided
from tests.abs_service.tracking.driving import TrackingSession, default_plan, drive, mean_errors, rig_of, simulate

SHARE = 0.05
SIGMA = 9.0
seeds = st.integers(0, 2**32 - 1)
SHAPE = (CAMERA.height, CAMERA.width)


@dataclass(frozen=True, slots=True)
class Given(TextureRegistrationNoise):
    """Texture registration noise that widens the noise by a given factor."""

    factor: np.ndarray

    def widening(self, gradients: np.ndarray, deviation: np.ndarray) -> Widening:
        return Widening(self.factor, np.log(self.factor))


def given_widening(generator: np.random.Generator, n: int) -> tuple[np.ndarray, Given]:
    factor = generator.uniform(1, 6, (n, 3)).astype(np.float32)
    return factor, Given(0.0, factor)


@settings(max_examples=8)
@given(seeds)
def test_the_color_cost_is_the_likelihood_of_widened_noise(seed):
    generator = np.random.default_rng(seed)
    vertices, normals = decided(generator, 40)
    colors = generator.uniform(0, 255, (len(vertices), 3)).astype(np.float32)
    image = generator.integers(0, 256, (*SHAPE, 3)).astype(np.uint8)
    for vertex, normal, color in zip(vertices, normals, colors):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            image[pixel] = np.clip(color + generator.normal(0, 20, 3), 0, 255)
    factor, misplaced = given_widening(generator, len(vertices))
    bounds = likelihood.Settings(SHARE).bounds(Sensor("color", CAMERA, GaussianColor(SIGMA)))
    term = ColorTerm("color", sparse(CAMERA), colors, GaussianColor(SIGMA), bounds, misplaced)
    term = term.observe(ColorImage(image), Prediction(in_sight(CAMERA, len(vertices))))
    points = vertices.astype(float), normals.astype(float)
    expected = reference.color_cost(CAMERA, SIGMA * factor, image, colors.astype(float), *points, SHARE)
    assert term.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, rel=1e-5)


@settings(max_examples=8)
@given(seeds, st.sampled_from(sorted(BAYER_ORDERS)))
def test_the_channel_cost_is_the_likelihood_of_widened_noise(seed, order):
    generator, pattern = np.random.default_rng(seed), BAYER_ORDERS[order]
    vertices, normals = decided(generator, 60)
    looks = generator.uniform(20, 235, (len(vertices), 3)).astype(np.float32)
    image = ChannelImage(generator.uniform(0, 255, SHAPE).astype(np.float32), pattern)
    for vertex, normal, look in zip(vertices.astype(float), normals, looks):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            image.values[pixel] = look[image.channel[pixel]] + generator.normal(0, 20)
    factor, misplaced = given_widening(generator, len(vertices))
    noise = GaussianBayer(SIGMA)
    bounds = likelihood.Settings(SHARE).bounds(Sensor("color", CAMERA, noise))
    term = ChannelTerm("color", sparse(CAMERA), looks, noise, Passive(), bounds, misplaced)
    term = term.observe(image, Prediction(in_sight(CAMERA, len(vertices))))
    expected = reference.channel_cost(
        *(CAMERA, noise, image.values, image.channel, np.zeros(SHAPE, bool)),
        *(looks, vertices.astype(float), normals.astype(float), SHARE, factor),
    )
    assert term.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, rel=2e-5, abs=1e-2)


def test_the_variance_grows_by_the_change_of_the_print_over_its_sigma():
    """A print whose red changes by 4000 levels per metre along x, seen from straight before it."""
    mesh = sheet()
    synthesizer = sparse(CAMERA, mesh)
    print_ = np.stack(
        [4000 * synthesizer.canvas.vertices[:, 0], *[np.full(len(synthesizer.canvas.vertices), 90.0)] * 2]
    )
    view = synthesizer.view("color", np.ascontiguousarray(print_.T, np.float32))
    predicted = as_surface((mesh.vertices, mesh.normals))
    seen = view.observe(predicted)
    gradients = seen.attribute_gradients(seen.synthesize(predicted))
    widening = TextureRegistrationNoise(0.3).widening(gradients, np.array([[SIGMA]]))
    here, ahead, aside = (
        np.stack([reference.project(CAMERA, vertex.astype(float) + step) for vertex in mesh.vertices])
        for step in 1e-4 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    )
    pixels_per_metre = np.stack([ahead - here, aside - here], axis=-1) / 1e-4
    slope = np.array([4000, 0]) @ np.linalg.inv(pixels_per_metre)
    expected = np.sqrt(1 + (0.3 * np.linalg.norm(slope, axis=1) / SIGMA) ** 2)
    assert expected.min() > 1.2
    np.testing.assert_allclose(widening.factor[:, 0], expected, rtol=0.03)
    np.testing.assert_allclose(widening.factor[:, 1:], 1, atol=1e-3)
    np.testing.assert_allclose(np.exp(widening.log), widening.factor, rtol=1e-5)


def test_where_every_candidate_has_samples_of_its_own_the_noise_is_the_sensor_s():
    mesh = sheet()
    rig = Rig("r", {"color": Sensor("color", CAMERA, GaussianColor())})
    synthesizer = dense.Settings().build(rig, mesh)
    view = synthesizer.view("color", np.ones((len(synthesizer.canvas.vertices), 3), np.float32))
    predicted = as_surface((mesh.vertices, mesh.normals))
    seen = view.observe(predicted)
    gradients = seen.attribute_gradients(seen.synthesize(predicted))
    assert TextureRegistrationNoise(0.3).widening(gradients, np.ones((1, 1))) is NO_WIDENING


@pytest.mark.slow
def test_a_board_with_sharp_edges_does_not_slide():
    """Without registration noise, a rigid board seen by a perfect lens slides from edge to edge of its print."""
    errors = []
    for px in (0.0, 0.2):
        board = simulate("simulated://board?seed=3&blur=0")
        plan = default_plan(model=rigid.Settings(), objective=likelihood.Settings(texture_registration_px=px))
        errors.append(mean_errors(list(drive(TrackingSession(rig_of(board), plan), board, range(150))))[0])
    print(f"vertex error {errors[0]:.2f} mm without and {errors[1]:.2f} mm with registration noise")
    assert errors[1] < min(2, 0.9 * errors[0])

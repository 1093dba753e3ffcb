"""A term of one number per pixel: its cost is the likelihood of grey, of every Bayer order and of lit surfaces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ONE_CHANNEL, ChannelImage, ColorImage
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.terms.base import Prediction
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.channel_cost import copy, fill
from abs_service.tracker.terms.photometric.exposure import gains
from abs_service.tracker.terms.photometric.illumination import Active, Passive, lambert
from abs_service.tracker.terms.photometric.occlusion import occluded_pixels
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from calib.rig import Rig, Sensor
from tests import reference
from tests.abs_service.tracker.scenes import CAMERA, as_surface, in_sight, observation, sheet, sparse
from tests.abs_service.tracker.synthesis.random_vertices import decided

SHARE = 0.05
seeds = st.integers(0, 2**32 - 1)
SHAPE = (CAMERA.height, CAMERA.width)
NOISES = {
    "grey": (GaussianGrey(12.0), ONE_CHANNEL),
    **{order: (GaussianBayer(9.0), pattern) for order, pattern in BAYER_ORDERS.items()},
    "passive": (GaussianIntensity("ir", 6.0, 0.1, "passive"), ONE_CHANNEL),
    "active": (GaussianIntensity("amplitude", 6.0, 0.1), ONE_CHANNEL),
}


def term(noise: reference.ChannelNoise, looks: np.ndarray, share: float = SHARE) -> ChannelTerm:
    """The term of single points that look like this."""
    active = isinstance(noise, GaussianIntensity) and noise.illumination == "active"
    bounds = likelihood.Settings(share).bounds(Sensor("color", CAMERA, noise))
    light = Active(CAMERA.center) if active else Passive()
    return ChannelTerm("color", sparse(CAMERA), looks, noise, light, bounds)


def test_the_four_orders_are_what_their_names_say():
    letters = {order: "".join("rgb"[channel] for channel in pattern.ravel()) for order, pattern in BAYER_ORDERS.items()}
    assert letters == {order: order for order in ("rggb", "bggr", "grbg", "gbrg")}


@pytest.mark.parametrize("name", NOISES)
@settings(max_examples=8)
@given(seeds)
def test_the_cost_is_the_likelihood(name, seed):
    """Values near those of the vertices, some beyond all noise, some unknown, some covered by what stands before."""
    generator, (noise, pattern) = np.random.default_rng(seed), NOISES[name]
    vertices, normals = decided(generator, 60)
    looks = generator.uniform(20, 235, (len(vertices), int(pattern.max()) + 1)).astype(np.float32)
    shine = np.ones(len(vertices))
    if name == "active":
        shine = np.array([reference.lambert(v, n, CAMERA.center) for v, n in zip(vertices.astype(float), normals)])
    shown = looks * shine[:, None]
    image = ChannelImage(generator.uniform(0, 255, SHAPE).astype(np.float32), pattern)
    for vertex, normal, look in zip(vertices.astype(float), normals, shown):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            image.values[pixel] = look[image.channel[pixel]] + generator.normal(0, 15)
    looks[::7] = np.nan
    made = term(noise, looks)
    hands = CAMERA.center + 0.5 * (vertices[vertices[:, 2] > 0][:3] - CAMERA.center)
    covered = occluded_pixels(CAMERA, hands)
    image.values[~covered & (generator.random(SHAPE) < 0.1)] = np.nan
    made = made.observe(image, Prediction(in_sight(CAMERA, len(vertices)), occluders=hands))
    expected = reference.channel_cost(
        *(CAMERA, noise, image.values, image.channel, covered),
        *(looks * shine[:, None], vertices.astype(float), normals.astype(float), SHARE),
    )
    assert made.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, rel=2e-5, abs=1e-2)


@given(seeds)
def test_lambert_s_law_is_its_equation(seed):
    generator = np.random.default_rng(seed)
    vertices = generator.uniform((-0.5, -0.4, 0.4), (0.5, 0.4, 1.6), (2, 30, 3))
    normals = generator.normal(size=(2, 30, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    found = lambert(as_surface(*zip(vertices, normals)), CAMERA.center)
    expected = [[reference.lambert(*pair, CAMERA.center) for pair in zip(*each)] for each in zip(vertices, normals)]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


@settings(max_examples=10)
@given(seeds, st.sampled_from(["grey", *BAYER_ORDERS]))
def test_the_euclidean_cost_is_the_weighted_squares(seed, name):
    """Unknown values, and differences above the cut-off, cost as much as a difference of the cut-off."""
    generator, (noise, pattern) = np.random.default_rng(seed), NOISES[name]
    mesh = sheet()
    mesh.colors[:] = generator.uniform(0, 255, mesh.colors.shape)
    sensor = Sensor("color", CAMERA, noise)
    objective = euclidean.Settings(color_weight=0.003, cutoff_levels=90.0).build(
        Rig("r", {"color": sensor}), mesh, sparse(CAMERA, mesh)
    )
    image = ChannelImage(generator.uniform(0, 255, SHAPE).astype(np.float32), pattern)
    surface = as_surface((mesh.vertices, mesh.normals))
    objective = objective.observe(observation(color=image), surface)
    looks, measured = mesh.appearance_of("color"), np.full(mesh.appearance_of("color").shape, np.nan)
    for v, (vertex, normal) in enumerate(zip(surface.vertices[0].T.astype(float), surface.normals[0].T)):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            measured[v, image.channel[pixel]] = image.values[pixel]
    off = np.nanmax(np.abs(measured - looks * gains(measured, looks)), axis=1, initial=-1)
    expected = 0.003 * np.sum(np.where(off < 0, 90.0, np.minimum(off, 90.0)) ** 2)
    assert objective.cost(surface)[0] == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize("name", NOISES)
def test_costs_do_not_depend_on_the_rest_of_the_population(name):
    noise, pattern = NOISES[name]
    generator, mesh = np.random.default_rng(3), sheet()
    looks = generator.uniform(20, 235, (len(mesh.vertices), int(pattern.max()) + 1)).astype(np.float32)
    made = term(noise, looks)
    image = ChannelImage(generator.uniform(0, 255, SHAPE).astype(np.float32), pattern)
    made = made.observe(image, Prediction(as_surface((mesh.vertices, mesh.normals))))
    surface = Rigid(mesh).deform(generator.normal(0, 0.02, (4, 6)))
    alone = [made.cost(as_surface((v.T, n.T)))[0] for v, n in zip(surface.vertices, surface.normals)]
    np.testing.assert_array_equal(made.cost(surface), alone)


def test_a_colour_image_is_not_one_number_per_pixel():
    made = term(GaussianGrey(), np.ones((4, 1), np.float32))
    with pytest.raises(TypeError, match="sensor color has noise of one channel but delivered ColorImage"):
        made.observe(ColorImage(np.zeros((*SHAPE, 3), np.uint8)), Prediction(in_sight(CAMERA, 4)))


@settings(max_examples=20)
@given(seeds, st.sampled_from([ONE_CHANNEL, *BAYER_ORDERS.values()]))
def test_texels_are_value_channel_inverse_deviation_and_normaliser(seed, pattern):
    """Deviations that change from pixel to pixel, and such that stay; what is unknown has the channel 0."""
    generator = np.random.default_rng(seed)
    shape = tuple(generator.integers(1, 9, 2))
    values = generator.uniform(0, 255, shape).astype(np.float32)
    deviation = generator.choice(np.array([2, 3, 50], np.float32), shape)
    found, image = np.empty((*shape, 4), np.float32), ChannelImage(values, pattern)
    (top, bottom), (left, right) = (np.sort(generator.integers(0, size + 1, 2)) for size in shape)
    part = slice(top, bottom), slice(left, right)
    fill(values, pattern, deviation, 0.7, 0, 0, found)
    expected = np.stack([values, image.channel, 1 / deviation, np.log(deviation) + np.float32(0.7)], axis=-1)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    again = np.zeros_like(found)
    fill(np.ascontiguousarray(values[part]), pattern, np.ascontiguousarray(deviation[part]), 0.7, top, left, again)
    np.testing.assert_array_equal(again[part], found[part])
    assert np.count_nonzero(again.any(axis=2)) <= (bottom - top) * (right - left)
    found[generator.random(shape) < 0.3] = np.nan
    bordered = np.ones((shape[0] + 2, shape[1] + 2, 4), np.float32)
    expected = bordered.copy()
    expected[1:-1, 1:-1][part] = found[part]
    expected[..., 1] = np.nan_to_num(expected[..., 1])
    copy(found, top, bottom, left, right, bordered)
    np.testing.assert_array_equal(bordered, expected)

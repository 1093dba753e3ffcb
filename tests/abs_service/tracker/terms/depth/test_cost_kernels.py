"""Compiled costs compute what their equations say."""

import numpy as np
import pytest
from hypothesis import given

from abs_service.pairing.images import ColorImage
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.depth_cost import FREE_SCALE_M, ConstantCosts, depth_cost, write_constants
from abs_service.tracker.terms.depth.texels import missing_texel
from abs_service.tracker.terms.photometric.color import ColorTerm
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from tests import reference
from tests.abs_service.tracker.scenes import (
    CAMERA,
    as_surface,
    depth_image,
    in_sight,
    observation,
    sheet,
    sparse,
)
from tests.abs_service.tracker.synthesis.random_vertices import decided, few, seeds

SHARE, RANGE_M = 0.05, 5.0


NOISE = GaussianPolynomial(((1e-3, 1e-7), (2e-3, 0.0)), ((5e-3,), (-2e-3,)), amplitudes=(0.0, 10_000.0))


def bounds() -> Bounds:
    return likelihood.Settings(SHARE, RANGE_M).bounds(Sensor("tof", CAMERA, NOISE))


@few
@given(seeds)
def test_the_depth_cost_is_the_likelihood(seed):
    generator = np.random.default_rng(seed)
    vertices, normals = decided(generator, 40)
    image = np.full((CAMERA.height, CAMERA.width), np.nan, np.float32)
    for vertex, normal in zip(vertices, normals):  # near the vertices, some of them beyond all noise
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            image[pixel] = reference.distance_at_center(CAMERA, vertex, normal) + generator.normal(0, 6e-3)
    image[generator.uniform(size=image.shape) < 0.1] = np.nan
    amplitude = generator.uniform(500, 9000, image.shape).astype(np.float32)
    term = DepthTerm("tof", sparse(CAMERA), sheet(), NOISE, bounds())
    term = term.observe(type(depth_image(image))(image, amplitude), Prediction(in_sight(CAMERA, len(vertices))))
    expected = reference.depth_cost(
        CAMERA, NOISE, image, amplitude, vertices.astype(float), normals.astype(float), SHARE, RANGE_M
    )
    assert term.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, abs=2e-3 * len(vertices))


@pytest.mark.parametrize(
    ("distance", "expected"),
    [(np.nan, "uniform"), (1.0, "noise"), (3.0, "outlier"), (0.5, "outlier")],
)
def test_what_one_measurement_costs(distance, expected):
    sigma = 2e-3
    camera = Camera(8, 6, 10.0, 10.0, 4.0, 3.0)  # the vertex is where a pixel's centre looks
    term = DepthTerm("tof", sparse(camera), sheet(), GaussianPolynomial(((sigma,),)), bounds())
    term = term.observe(depth_image(np.full((6, 8), distance)), Prediction(in_sight(camera, 1)))
    cost = term.cost(as_surface((np.array([[0, 0, 1.0]]), np.array([[0, 0, -1.0]]))))[0]
    density = {
        "uniform": (1 - SHARE) / RANGE_M,
        "noise": (1 - SHARE) / (np.sqrt(2 * np.pi) * sigma),
        "outlier": SHARE / RANGE_M,
    }
    assert cost == pytest.approx(-np.log(density[expected]), rel=1e-5)


@few
@given(seeds)
def test_pixels_that_say_nothing_of_distances_become_constants(seed):
    generator = np.random.default_rng(seed)
    height, width, top, left = (*generator.integers(1, 8, 2), *generator.integers(0, 3, 2))
    texture = generator.normal(size=(top + height + 3, left + width + 4, 8)).astype(np.float32)
    silent = generator.uniform(size=(height, width)) < 0.3
    free_m = (generator.uniform(0, 0.5, (height, width)) * (generator.uniform(size=(height, width)) < 0.3)).astype("f4")
    missing = generator.uniform(size=(height, width)) < 0.3
    expected = texture.copy()
    inner = expected[1 + top : 1 + top + height, 1 + left : 1 + left + width]
    inner[missing] = np.eye(8)[6] * -2.5 + np.eye(8)[7]
    inner[silent] = np.eye(8)[6] * -2.5
    inner[free_m > 0] = np.eye(8)[6] * (7.0 + free_m[free_m > 0, None] / FREE_SCALE_M)
    distance = np.where(missing, np.nan, 1).astype(np.float32)
    costs = ConstantCosts(silent, distance, free_m, missing_texel(-2.5), -2.5, 7.0)
    write_constants(costs, (top, left), texture)
    np.testing.assert_allclose(texture, expected, rtol=1e-5)


@few
@given(seeds)
def test_a_missing_return_costs_a_sample_its_own_surprise(seed):
    """In a population; beside it, a texel of constant cost and a measurement, each costs what it did."""
    generator = np.random.default_rng(seed)
    n, members = 40, 3
    agreeing, constant, measured = (np.zeros(8, np.float32) for _ in range(3))
    agreeing[6:], constant[6] = (-2.5, 1.0), 3.5
    measured[[0, 3, 6]] = 1.0, 200.0, -3.0
    texture = np.stack([constant, agreeing, measured])
    pixel = generator.integers(-1, 3, (members, n)).astype(np.int32)
    distance = generator.normal(1.0, 5e-3, (members, n)).astype(np.float32)
    surprise = generator.uniform(0, 7, (generator.choice([1, members]), n)).astype(np.float32)
    out = np.empty(members)
    depth_cost(pixel, distance, surprise, texture, 0.05, 4.6, out)
    measurement = np.minimum(0.05 + 0.5 * (200 * (1.0 - distance.astype(float))) ** 2 - 3.0, 4.6)
    expected = np.select([pixel == 0, pixel == 1, pixel == 2], [0.05 + 3.5, 0.05 - 2.5 + surprise, measurement], 0.0)
    np.testing.assert_allclose(out, expected.sum(axis=1), rtol=1e-4)


@few
@given(seeds)
def test_the_color_cost_is_the_likelihood(seed):
    generator = np.random.default_rng(seed)
    vertices, normals = decided(generator, 40)
    colors = generator.uniform(0, 255, (len(vertices), 3)).astype(np.float32)
    image = generator.integers(0, 256, (CAMERA.height, CAMERA.width, 3)).astype(np.uint8)
    for vertex, normal, color in zip(vertices, normals, colors):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        if pixel is not None:
            image[pixel] = np.clip(color + generator.normal(0, 15, 3), 0, 255)
    colors[::5] = np.nan
    sensor = Sensor("color", CAMERA, GaussianColor(12.0))
    mesh = sheet()
    objective = likelihood.Settings(SHARE).build(
        Rig("r", {"color": sensor}), type(mesh)(*_replaced(mesh, colors)), sparse(CAMERA)
    )
    objective = objective.observe(observation(color=ColorImage(image)), in_sight(CAMERA, len(vertices)))
    expected = reference.color_cost(
        CAMERA, 12.0, image, colors.astype(float), vertices.astype(float), normals.astype(float), SHARE
    )
    assert objective.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, rel=1e-5)


def _replaced(mesh, colors):
    return mesh.vertices, mesh.faces, colors, mesh.chart


@few
@given(seeds)
def test_the_stretch_cost_is_that_of_relative_changes_of_length(seed):
    generator, mesh = np.random.default_rng(seed), sheet(4, 5)
    prior = StretchPrior(mesh, 0.02)
    moved = (mesh.vertices + generator.normal(0, 2e-3, (2, *mesh.vertices.shape))).astype(np.float32)
    costs = prior.cost(as_surface(*((vertices, mesh.normals) for vertices in moved)))
    expected = [reference.stretch_cost(mesh.vertices, v.astype(float), mesh.edges, 0.02) for v in moved]
    np.testing.assert_allclose(costs, expected, rtol=2e-4)


@few
@given(seeds)
def test_the_euclidean_cost_is_exactly_the_weighted_squares(seed):
    """Missing measurements, and those beyond the cut-offs, cost as much as a difference of the cut-off."""
    generator = np.random.default_rng(seed)
    vertices, normals = decided(generator, 30)
    colors = generator.uniform(0, 255, (len(vertices), 3)).astype(np.float32)
    colors[::6] = np.nan
    image = generator.integers(0, 256, (CAMERA.height, CAMERA.width, 3)).astype(np.uint8)
    distance = np.full((CAMERA.height, CAMERA.width), np.nan, np.float32)
    weights = euclidean.Settings(4000.0, 0.003, 0.02, 90.0)
    expected = 0.0
    for vertex, normal, color in zip(vertices.astype(float), normals, colors):
        pixel = reference.seen_pixel(CAMERA, vertex, normal)
        squares = [0.02**2, 90.0**2]
        if pixel is not None:
            synthesized = reference.distance_at_center(CAMERA, vertex, normal)
            if np.isnan(distance[pixel]):  # else another vertex is seen by the same pixel
                distance[pixel] = np.float32(synthesized + generator.normal(0, 0.015))
            squares[0] = min((float(distance[pixel]) - synthesized) ** 2, squares[0])
            if np.isfinite(color).all():
                squares[1] = min(float(np.sum((image[pixel] - color.astype(float)) ** 2)), squares[1])
        expected += 4000.0 * squares[0] + 0.003 * squares[1]
    rig = Rig("r", {"tof": Sensor("tof", CAMERA, StructuredLight()), "color": Sensor("color", CAMERA, GaussianColor())})
    mesh = sheet()
    objective = weights.build(rig, type(mesh)(*_replaced(mesh, colors)), sparse(CAMERA))
    objective = objective.observe(
        observation(tof=depth_image(distance), color=ColorImage(image)), in_sight(CAMERA, len(vertices))
    )
    assert objective.cost(as_surface((vertices, normals)))[0] == pytest.approx(expected, abs=2e-3)


def test_a_missing_sensor_costs_nothing():
    rig = Rig("r", {"tof": Sensor("tof", CAMERA, NOISE), "color": Sensor("color", CAMERA, GaussianColor())})
    mesh = sheet()
    both, alone = (likelihood.Settings().build(rig, mesh, sparse(CAMERA, mesh)) for _ in range(2))
    depth = depth_image(np.ones((CAMERA.height, CAMERA.width)))
    surface = as_surface((mesh.vertices, mesh.normals))
    black = ColorImage(np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8))
    both = both.observe(observation(tof=depth, color=black), surface)
    alone = alone.observe(observation(tof=depth, missing=("color",)), surface)
    assert alone.cost(surface)[0] < both.cost(surface)[0]
    assert [fit.sensor for fit in alone.fits(surface)] == ["tof"]


def test_costs_do_not_depend_on_the_rest_of_the_population():
    mesh = sheet()
    predicted = as_surface((mesh.vertices, mesh.normals))
    term = DepthTerm("tof", sparse(CAMERA, mesh), mesh, NOISE, bounds())
    term = term.observe(depth_image(np.full((CAMERA.height, CAMERA.width), 1.0)), Prediction(predicted))
    color = ColorTerm("color", sparse(CAMERA, mesh), mesh.colors, GaussianColor(), bounds())
    color = color.observe(ColorImage(np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)), Prediction(predicted))
    generator = np.random.default_rng(3)
    population = [(mesh.vertices + generator.normal(0, 5e-3, 3), mesh.normals) for _ in range(4)]
    for part in (term, color):
        together = part.cost(as_surface(*population))
        np.testing.assert_array_equal(together, [part.cost(as_surface(pair))[0] for pair in population])

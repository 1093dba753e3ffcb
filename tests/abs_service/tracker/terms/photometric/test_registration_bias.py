"""Bias of a registration: sharp edges along the pixels move a print as a whole, smooth prints do not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesis
from abs_service.tracker.terms.photometric.registration_bias import MAX_PX, RegistrationBias, deviation_px
from calib import pose
from calib.camera import Camera
from tests.abs_service.tracker.scenes import as_surface, seen

ROWS, COLUMNS = np.mgrid[:120, :160].astype(np.float64)

#: Vertices of a mesh, five pixels apart.
PLACES = np.stack(np.meshgrid(np.arange(8.3, 150, 5), np.arange(8.3, 110, 5)), axis=-1).reshape(-1, 2)

#: Edges of stripes, not a whole number of pixels apart.
EDGES, SIGNS = np.arange(20, 140, 20) + np.array([0.1, -0.4, 0.3, 0.2, -0.1, 0.45]), np.array([1, -1, 1, -1, 1, -1])


def stripes(x: np.ndarray) -> np.ndarray:
    """Values of a print with sharp edges at coordinates across them [px]."""
    return 100 + 80 * np.sum(SIGNS * np.tanh(1.5 * (x[..., None] - EDGES)), axis=-1)


def slope(x: np.ndarray) -> np.ndarray:
    """Derivative of `stripes`."""
    return 120 * np.sum(SIGNS / np.cosh(1.5 * (x[..., None] - EDGES)) ** 2, axis=-1)


def edges(angle: float) -> np.ndarray:
    """Image of the stripes, turned by an angle (height, width, 1)."""
    return stripes(COLUMNS * np.cos(angle) + ROWS * np.sin(angle))[..., None].astype(np.float32)


def at(camera: Camera, vertices: np.ndarray) -> tuple[Synthesis, Surface]:
    surface = as_surface((vertices, vertices))
    return seen(camera, surface), surface


def test_edges_along_the_pixels_move_a_print_and_slanted_ones_do_not():
    upright, slanted = (deviation_px(edges(angle), PLACES) for angle in (0.0, 0.5))
    assert 0.02 < upright < 0.2
    assert slanted < upright / 3


def test_a_registration_is_moved_by_as_much_as_is_said():
    """Vertices in columns, read in the first image and synthesised in a later one, at random places between pixels."""
    generator, image = np.random.default_rng(0), edges(0.0)
    moved, said = [], []
    for _ in range(200):
        x = np.arange(8.0, 150, 4) + generator.uniform(0, 4)
        left, place = np.floor(x), x - np.floor(x)
        first = (1 - place) * stripes(left) + place * stripes(left + 1)
        later = generator.uniform(-0.5, 0.5)
        step = np.floor(x + later + 0.5) - (x + later)
        wrong = first + slope(x) * step - stripes(x + step)
        moved.append(slope(x) @ wrong / (slope(x) @ slope(x)))
        rows = np.arange(8.0, 110, 5)
        places = np.stack([np.tile(x, len(rows)), rows.repeat(len(x))], axis=1)
        said.append(deviation_px(image, places) * np.sqrt(2))  # there is nothing the other way
    assert np.median(said) / np.median(np.abs(moved)) == pytest.approx(1, abs=0.4)


def test_a_smooth_print_and_noise_have_no_bias():
    smooth = (100 + 50 * np.sin(COLUMNS / 9) + 50 * np.cos(ROWS / 7))[..., None]
    noise = np.random.default_rng(0).normal(0, 3, smooth.shape)
    assert deviation_px(smooth.astype(np.float32), PLACES) < 0.01
    assert deviation_px((smooth + noise).astype(np.float32), PLACES) < 0.015
    assert deviation_px(np.full((120, 160, 3), 7, np.uint8), PLACES) == 0


@given(st.integers(0, 2**32 - 1))
def test_nothing_but_numbers_comes_of_any_image(seed):
    generator = np.random.default_rng(seed)
    image = generator.normal(100, 50, (12, 10, 1)).astype(np.float32)
    image[generator.random(image.shape) < generator.random()] = np.nan
    places = generator.uniform(-5, 20, (30, 2))
    places[generator.random(30) < 0.2] = np.nan
    assert 0 <= deviation_px(image, places) <= MAX_PX


def test_the_derivatives_are_those_of_a_shift_of_the_image():
    camera = Camera(160, 120, 150.0, 140.0, 80.0, 60.0, T_rs=pose.look_at((0.1, 0.2, -0.3), (0.0, 0.0, 1.0)))
    bias = RegistrationBias(camera)
    vertices = np.random.default_rng(1).uniform((-0.2, -0.2, 0.8), (0.2, 0.2, 1.2), (9, 3)).astype(np.float32)
    bias.observe(edges(0.0), *at(camera, vertices))
    points, gradient = np.array([3, 3, 7]), np.array([[5.0, 1.0], [-2.0, 4.0], [0.5, 0.0]])
    rows = np.einsum("mi,mij->mj", gradient, camera.projection_jacobian(vertices[points]))
    expected = gradient * deviation_px(edges(0.0), camera.project(vertices))
    np.testing.assert_allclose(bias.derivatives(vertices, rows, points), expected, atol=1e-12)


def test_the_first_image_tells_how_large_it_is():
    camera = Camera(160, 120, 150.0, 150.0, 80.0, 60.0)
    bias, point = RegistrationBias(camera), np.array([0])
    vertices = np.concatenate([(PLACES - (80.0, 60.0)) / 150.0, np.ones((len(PLACES), 1))], axis=1)
    row = np.array([[1.0, 1.0, 0.0]])
    assert not bias.derivatives(vertices, row, point).any()
    bias.observe(edges(0.0), *at(camera, vertices))
    first = bias.derivatives(vertices, row, point)
    bias.observe(edges(0.5), *at(camera, vertices))
    np.testing.assert_array_equal(bias.derivatives(vertices, row, point), first)
    assert first == pytest.approx(deviation_px(edges(0.0), PLACES) / 150.0)

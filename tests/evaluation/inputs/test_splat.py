"""Splats keep single measurements, cover the surface up to its rims, and know how uncertain that makes them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib import pose
from calib.camera import Camera
from calib.warp import errors
from calib.warp.mesh import MAX_STEP_M
from evaluation.inputs.warping.splat import WIDTH, SplatWarp
from tests.calib.warp.scenes import BOARD, SOURCE, VIEWS, WALL, image, seen_by

ANY_VIEW = pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)


@ANY_VIEW
def test_the_surface_is_covered_without_gaps_and_without_bias(view):
    distance = image(SOURCE, (WALL,))
    warped, truth = SplatWarp(SOURCE, view).warp(distance), image(view, (WALL,))
    inside, _ = seen_by(SOURCE, view.unproject(truth), (WALL,))
    known = np.isfinite(warped.distance)
    assert known[inside].all()
    error = (warped.distance - truth)[known & inside]
    assert abs(error.mean()) < 3e-4
    assert np.quantile(np.abs(error), 0.95) < 0.01  # half a pixel of 20 mm on a slope


def test_what_is_nearer_hides_what_is_behind_it():
    view = VIEWS["pinhole"]
    warped, truth = SplatWarp(SOURCE, view).warp(image(SOURCE, (BOARD, WALL))), image(view, (BOARD, WALL))
    board = np.abs(truth - image(view, (BOARD,))) < 1e-9
    assert np.mean(np.abs(warped.distance - truth)[board] < 0.02) > 0.99


def test_a_single_measurement_is_kept_with_its_deviation():
    distance = np.full((SOURCE.height, SOURCE.width), np.nan)
    distance[30, 40] = 1.0
    warped = SplatWarp(SOURCE, SOURCE).warp(distance)
    rows, columns = np.nonzero(np.isfinite(warped.distance))
    assert (rows.tolist(), columns.tolist()) == ([30], [40])
    assert warped.distance[30, 40] == pytest.approx(1.0, rel=1e-5)
    assert warped.deviation(np.full(distance.shape, 3e-3))[30, 40] == pytest.approx(3e-3, rel=0.02)


def test_the_deviation_is_not_too_small():
    view, generator, sigma = VIEWS["pinhole"], np.random.default_rng(3), 2e-3
    clean, truth = image(SOURCE, (WALL,)), image(view, (WALL,))
    inside, _ = seen_by(SOURCE, view.unproject(truth), (WALL,))
    squares = []
    for _ in range(20):
        warped = SplatWarp(SOURCE, view).warp(clean + generator.normal(0, sigma, clean.shape))
        squares.append(((warped.distance - truth) / warped.deviation(np.full(clean.shape, sigma)))[inside] ** 2)
    assert 0.2 < np.mean(squares) < 1.1


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_kernels_are_their_definition(seed):
    generator = np.random.default_rng(seed)
    source = Camera(6, 5, 9.0, 9.0, 2.5, 2.0)
    view = Camera(14, 12, 20.0, 21.0, 6.6, 5.7, T_rs=pose.from_rotation_vector([0.1, 0, 0.2], [0.05, 0, -0.02]))
    distance = generator.choice([0.9, 1.4], (5, 6)) + generator.uniform(0, 0.02, (5, 6))
    distance[generator.random((5, 6)) < 0.2] = np.nan
    sigma = generator.uniform(1e-3, 5e-3, (5, 6))
    warped = SplatWarp(source, view).warp(distance)
    points = pose.transform(view.T_sr, source.unproject(distance))
    place, near = view.project(source.unproject(distance)), 1 / points[..., 2]
    half = 0.5 * WIDTH * np.array([view.fx / source.fx, view.fy / source.fy]) * source.rays()[..., 2:] * near[..., None]
    half = half * distance[..., None]
    found, spread = warped.distance, warped.deviation(sigma)
    for row, column in np.ndindex(view.height, view.width):
        off = np.abs(place - (column, row)) / half
        touching = np.all(off <= 1, axis=-1)
        if np.any(np.abs(off - 1) < 1e-3):
            continue  # single precision may decide otherwise
        front = near[touching].max(initial=0)
        behind = touching & (1 / near <= 1 / front + MAX_STEP_M) if front else touching
        assert np.isfinite(found[row, column]) == behind.any()
        if behind.any():
            weight = np.prod(1 - off[behind], axis=-1)
            z = weight.sum() / (weight * near[behind]).sum()
            assert found[row, column] == pytest.approx(z / view.rays()[row, column, 2], rel=1e-5)
            apart = np.average((near[behind] * z - 1) ** 2, weights=weight) * z**2
            expected = np.sqrt(np.sum((weight * sigma[behind]) ** 2) / weight.sum() ** 2 + apart)
            assert spread[row, column] == pytest.approx(expected, rel=0.02, abs=2e-4)


def test_there_is_no_silent_empty_image():
    with pytest.raises(errors.NoReturnsError):
        SplatWarp(SOURCE, SOURCE).warp(np.full((SOURCE.height, SOURCE.width), np.nan))
    behind = Camera(32, 24, 40.0, 40.0, 15.5, 11.5, T_rs=pose.from_rotation_vector([0, np.pi, 0], [0, 0, 0]))
    with pytest.raises(errors.NoOverlapError, match="check both T_rs"):
        SplatWarp(SOURCE, behind).warp(image(SOURCE, (WALL,)))

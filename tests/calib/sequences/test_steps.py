"""Quantisation is told from the values, whatever unit the file counts in."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.sequences.steps import Steps, recognize

RANDOM = np.random.default_rng
#: Growth of the simulated disparity's steps [1/m].
GROWTH = 2.85e-3


def disparity(near: float, far: float, noise: float = 0.5) -> np.ndarray:
    """Distances [m] of 20 exposures of a slope, from whole disparities; noise in steps."""
    disparities = 1 / GROWTH / np.linspace(near, far, 60 * 80).reshape(60, 80)
    return 1 / GROWTH / np.rint(disparities + noise * RANDOM(0).standard_normal((20, 60, 80)))


def stored(lengths: np.ndarray, unit: float) -> np.ndarray:
    return (np.rint(lengths / unit) * unit).astype(np.float32)


@pytest.mark.parametrize("unit", [1e-3, 2e-4, 1e-4])
@pytest.mark.parametrize("span", [(0.5, 3.5), (2.0, 3.5), (1.0, 1.1)])
def test_steps_of_a_disparity_do_not_depend_on_the_unit_of_the_file(unit: float, span: tuple[float, float]) -> None:
    in_millimetres = stored(disparity(*span), 1e-3)
    found = recognize(stored(in_millimetres * 1.0003, unit), unit)
    x = np.array(span)
    np.testing.assert_allclose(found.at(x), np.maximum(GROWTH * x**2, 1e-3), rtol=0.15)


def test_numbers_without_a_unit_have_the_steps_that_are_seen() -> None:
    assert recognize(disparity(0.5, 3.5).astype(np.float32), 0.0).growth == pytest.approx(GROWTH, rel=0.15)
    constant = stored(np.linspace(1, 2, 4800).reshape(60, 80) + 2e-3 * RANDOM(1).standard_normal((20, 60, 80)), 5e-3)
    for unit in (0.0, 1e-3):
        np.testing.assert_allclose(recognize(constant, unit).at(np.array([1.0, 2.0])), 5e-3, rtol=1e-3)


def test_steps_of_no_law_are_those_that_were_observed() -> None:
    x = np.linspace(1, 4, 4800).reshape(60, 80) + 5e-3 * RANDOM(2).standard_normal((20, 60, 80))
    found = recognize(np.where(x < 2, stored(x, 5e-3), stored(x, 2e-2)), 1e-4)
    assert found.growth == 0
    np.testing.assert_allclose(found.at(np.array([1.2, 3.5])), [5e-3, 2e-2], rtol=0.01)


def test_noise_that_is_larger_than_the_unit_is_no_step() -> None:
    x = np.linspace(1, 4, 4800).reshape(60, 80) + 5e-3 * RANDOM(3).standard_normal((20, 60, 80))
    assert recognize(x, 0.0) == Steps()
    assert recognize(stored(x, 1e-4), 1e-4) == Steps(1e-4)


def test_a_sensor_that_never_changes_shows_its_steps_in_the_image() -> None:
    found = recognize(stored(disparity(0.8, 2.5, noise=0.0), 1e-4), 1e-4)
    assert found.growth == pytest.approx(GROWTH, rel=0.15)


@pytest.mark.parametrize("unit_mm", [1.0, 0.2, 0.1])
def test_steps_of_a_real_sensor_do_not_depend_on_the_unit_of_the_file(
    data_set: Callable[[str], Path], unit_mm: float
) -> None:
    files = sorted(data_set("sl_rgbd_deform_petit").glob("depth_mm_*.png"))[:40]
    images = np.array([cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files], np.float64)
    images[images == 0] = np.nan
    found = recognize(np.rint(images / unit_mm) * unit_mm * 1e-3, unit_mm * 1e-3)
    assert found.growth == pytest.approx(2.85e-3, rel=0.1)
    assert found.at(np.array([2.5])) / np.sqrt(12) > 0.0045

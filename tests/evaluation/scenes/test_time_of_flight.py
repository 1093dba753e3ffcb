"""The experiments' time-of-flight camera errs as its law says."""

import dataclasses

import numpy as np
import pytest

from drivers.contract.frame import Kind
from evaluation.scenes.rendering import View
from evaluation.scenes.time_of_flight import LEVELS, RANGE_M, TimeOfFlight, frame_set

SHAPE = (60, 80)


def view(distance: float, light: float) -> View:
    """The same everywhere."""
    full = np.ones(SHAPE)
    return View(distance * full, light * full, np.zeros((*SHAPE, 3)), full)


def test_deviation_and_mean_are_those_of_the_law() -> None:
    sensor = TimeOfFlight(mu_offset=0.1, mu_amplitude=-30.0)
    seen = view(1.2, 0.3)
    error = sensor.measure(seen, np.random.default_rng(0)).distance - 1.2
    assert error.mean() == pytest.approx(0.1 - 30 / 3000, abs=3e-4)
    assert error.std() == pytest.approx(0.0015 + 9 / 3000, rel=0.05)


def test_every_pixel_errs_by_its_own_factor() -> None:
    factor = np.linspace(0.5, 3, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    sensor, generator = TimeOfFlight(factor), np.random.default_rng(1)
    errors = np.stack([sensor.measure(view(1.0, 0.5), generator).distance - 1 for _ in range(300)])
    assert errors.std(axis=0) / factor == pytest.approx(np.full(SHAPE, 0.0033), rel=0.25)


def test_the_mean_of_many_exposures_errs_less() -> None:
    error = TimeOfFlight().measure(view(1.0, 0.1), np.random.default_rng(2), exposures=100).distance - 1
    assert error.std() == pytest.approx((0.0015 + 9 / 1000) / 10, rel=0.05)


def test_what_is_too_faint_or_out_of_range_has_no_return() -> None:
    generator = np.random.default_rng(3)
    assert np.isnan(TimeOfFlight(minimum_amplitude=200.0).measure(view(1.0, 1e-3), generator).distance).all()
    assert np.isnan(TimeOfFlight().measure(view(5.2, 0.5), generator).distance).all()


def test_frames_hold_what_was_measured() -> None:
    seen = view(1.0, 0.5)
    dark = dataclasses.replace(seen, light=np.where(np.arange(80) < 10, 0.0, seen.light))
    measured = TimeOfFlight().measure(dark, np.random.default_rng(4))
    frames = frame_set(measured, 7, 123).frames
    depth, amplitude = (frames["tof", kind.value] for kind in (Kind.DEPTH, Kind.AMPLITUDE))
    np.testing.assert_array_equal(depth.si(), measured.distance)
    np.testing.assert_array_equal(amplitude.si(), measured.amplitude)
    assert np.isnan(depth.si()[:, :10]).all()
    steps = depth.si()[:, 10:] / (RANGE_M / LEVELS)
    assert np.abs(steps - np.rint(steps)).max() < 1e-2

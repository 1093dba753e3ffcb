"""Verdicts of a noise calibration: a model that contradicts what was measured is bad, whatever its likelihood."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.calibration.noise import measurement
from abs_service.calibration.noise.verdicts import verdicts
from abs_service.calibration.shots import sequences
from abs_service.report.content import Level
from calib.noise.constant import Constant
from tests.calib.sequences.walls import frames


def learnt(sensor: str, distances: tuple[float, ...], unit: float) -> measurement.NoiseCalibration:
    """Model learnt from walls at known distances, stored in a unit [m]."""
    found = []
    for distance in distances:
        taken, head = frames(f"simulated://wall?sensors={sensor}&distance={distance}&tilt=6", 0, 20)
        (one,) = sequences.of_frames(f"{distance} m", taken, {sensor.partition("&")[0]: head.camera}, "", 20)
        lengths = (np.rint(one.lengths / unit) * unit).astype(np.float32)
        found.append(replace(one, lengths=lengths, digit=unit))
    region = np.ones(found[0].lengths.shape[1:], bool)
    return measurement.calibrate(found, distances, region, np.random.default_rng(0), lambda text: None)


@pytest.fixture(scope="module")
def found() -> measurement.NoiseCalibration:
    return learnt("tof&tof=32x24", (1.2,), 1e-3)


def worst(found: measurement.NoiseCalibration) -> tuple[Level, list[str]]:
    said = verdicts(found)
    return max(one.level for one in said), [one.text for one in said if one.level is Level.BAD]


def test_a_curve_that_misses_what_was_measured_is_bad(found: measurement.NoiseCalibration) -> None:
    assert worst(found)[0] < Level.BAD
    for sigma in (6e-5, 0.1):
        level, (text,) = worst(replace(found, model=Constant(sigma)))
        assert level is Level.BAD
        assert f"σ is {sigma * 1e3:g} mm at 1.2" in text


def test_what_is_not_a_number_is_bad(found: measurement.NoiseCalibration) -> None:
    no_quality = replace(found.chosen, quality=replace(found.chosen.quality, variance=np.nan))
    assert "does not tell whether" in worst(replace(found, chosen=no_quality))[1][0]
    assert "gives no σ" in worst(replace(found, model=Constant(np.nan)))[1][0]


@pytest.mark.slow
def test_noise_much_smaller_than_the_steps_does_not_hide_them() -> None:
    result = learnt("structured_light&noise=0.05&structured_light=48x36", (0.8, 1.2, 1.6), 1e-4)
    rows, columns = (part.ravel() for part in np.indices((36, 48)))
    for distance in (0.8, 1.2, 1.6):
        x = np.full(rows.size, distance)
        of_steps = 2.85e-3 * distance**2 / np.sqrt(12)
        assert 0.6 < result.model.deviation(x, x, (rows, columns)).min() / of_steps < 1.5
    assert worst(result)[0] < Level.BAD


def test_a_pattern_of_the_pixels_that_a_map_holds_is_no_noise_that_is_missed() -> None:
    result = learnt("tof&tof=32x24&reflectivity=0.9&pattern=0.008", (0.8, 1.2, 1.6), 1e-3)
    assert result.chosen.candidate.level == "pixel"
    assert max(row.fixed / row.temporal for _, row in result.rows) > 2
    assert worst(result)[0] < Level.BAD
    assert worst(replace(result, model=Constant(2e-4)))[0] is Level.BAD


def test_a_distance_that_the_target_cannot_have_is_named(found: measurement.NoiseCalibration) -> None:
    assert not any("--distance-m says" in one.text for one in verdicts(found))
    rows = tuple((name, replace(row, offset=-0.04 * row.distance)) for name, row in found.rows)
    (said,) = (one for one in verdicts(replace(found, rows=rows)) if "--distance-m says" in one.text)
    assert said.level is Level.DOUBTFUL
    assert "4.0% shorter" in said.text


def test_a_sensor_that_shakes_is_named(found: measurement.NoiseCalibration) -> None:
    assert not any("change together" in one.text for one in verdicts(found))
    (static,) = found.statics
    shifts = np.sqrt(np.mean(static.variance[static.still])) * np.sin(np.arange(len(static.distance)))[:, None, None]
    shaken = replace(found, statics=(replace(static, distance=static.distance + shifts),))
    (said,) = (one for one in verdicts(shaken) if "change together" in one.text)
    assert said.level is Level.DOUBTFUL

"""Noise on real data: static parts of a sequence in which hands move, and a frame with the sensor's own deviations."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service.calibration.noise import measurement, verdicts
from abs_service.report.content import Level
from calib.sequences import selection
from evaluation.calibration import noise_calibration

#: Bins of distance in which most of what is seen is at rest, so that the published deviation is one of noise [mm].
AT_REST = ((450, 550), (550, 650), (1000, 1300), (1300, 1700), (2200, 2800), (2800, 3500))


@pytest.mark.slow
def test_static_parts_of_a_real_sequence_have_the_published_noise(data_set: Callable[[str], Path]) -> None:
    static, one = noise_calibration.petit(data_set("sl_rgbd_deform_petit").parent)
    assert static.steps.growth == pytest.approx(2.85e-3, rel=0.1)
    rows = zip(noise_calibration.BINS, noise_calibration.WITH_MOTION, noise_calibration.by_distance(static, one))
    for place, published, (still, everything, _, pixels) in rows:
        assert everything == pytest.approx(published, rel=0.15)  # what moves left in: the published evaluation
        assert pixels > 200
        if place in AT_REST:
            assert still == pytest.approx(published, rel=0.25)
        else:
            assert still < 0.5 * published
    assert 0.1 < static.moving < 0.5


def test_the_o3r_claims_less_than_neighbouring_pixels_differ_by(data_set: Callable[[str], Path]) -> None:
    everything, near, *_ = noise_calibration.o3r(data_set("tof_ifm_o3r").parent)
    assert everything.pixels > 4000
    assert everything.within_95 == pytest.approx(0.354, abs=0.03)
    assert near.ratio == pytest.approx(1.69, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("unit_mm", [1.0, 0.2, 0.1])
def test_the_noise_of_a_real_sensor_does_not_depend_on_the_unit_of_the_file(
    data_set: Callable[[str], Path], unit_mm: float
) -> None:
    _, one = noise_calibration.petit(data_set("sl_rgbd_deform_petit").parent)
    unit = unit_mm * 1e-3
    stored = replace(one, lengths=(np.rint(one.lengths / unit) * unit).astype(np.float32), digit=unit)
    everywhere = np.ones(one.lengths.shape[1:], bool)
    found = measurement.calibrate([stored], [np.nan], everywhere, np.random.default_rng(0), lambda text: None)
    assert selection.typical_sigma(found.model, 2.5, 0.0) == pytest.approx(9.3e-3, rel=0.2)  # NumPy, frame to frame
    assert selection.typical_sigma(found.model, 0.6, 0.0) == pytest.approx(0.5e-3, rel=0.2)
    assert max(one.level for one in verdicts.verdicts(found)) < Level.BAD

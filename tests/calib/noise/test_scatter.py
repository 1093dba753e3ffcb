"""The scatter of an image is its noise, whatever else is in sight."""

import numpy as np

from calib.noise.fit.scatter import scatter

ROWS, COLUMNS = np.mgrid[:240, :320]
NOISE = np.random.default_rng(1).normal(0, 2e-3, ROWS.shape)


def test_a_tilted_plane_scatters_by_its_noise():
    assert abs(scatter(1 / (1.5 + 1e-3 * COLUMNS + 5e-4 * ROWS + NOISE)) / 2e-3 - 1) < 0.1


def test_clutter_edges_and_holes_in_half_of_the_image_do_not_count():
    inverse = 1.5 + 1e-3 * COLUMNS + NOISE
    inverse[:, :160] += 0.3 * np.sin(COLUMNS[:, :160] / 3) * np.sin(ROWS[:, :160] / 4)
    inverse[::50, 160:] = np.nan
    assert abs(scatter(1 / inverse) / 2e-3 - 1) < 0.15


def test_too_little_is_unknown():
    assert np.isnan(scatter(np.full((240, 320), np.nan)))
    assert np.isnan(scatter(np.full((4, 320), 1.0)))

"""The scatter of an image is its noise, whatever else is in sight."""

import numpy as np
from scipy.ndimage import gaussian_filter

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


def test_errors_that_neighbours_share_are_seen_in_part():
    """Those of a stereo camera: hardly any from pixel to pixel, and as large as white noise over ten."""
    alike = gaussian_filter(NOISE, 6)
    alike *= 2e-3 / alike.std()
    assert 0.8e-3 < scatter(1 / (1.5 + 1e-3 * COLUMNS + alike + 0.2 * NOISE)) < 2e-3


def test_bends_and_wrinkles_are_no_noise():
    bent = 1.5 + 2e-5 * (COLUMNS - 160) ** 2 - 1e-5 * (ROWS - 120) ** 2
    assert abs(scatter(1 / (bent + NOISE)) / 2e-3 - 1) < 0.1
    wrinkled = bent + 0.02 * np.sin(COLUMNS / 12)
    assert scatter(1 / (wrinkled + NOISE)) < 3.5 * scatter(1 / (bent + NOISE))


def test_too_little_is_unknown():
    assert np.isnan(scatter(np.full((240, 320), np.nan)))
    assert np.isnan(scatter(np.full((4, 320), 1.0)))

"""Parameters of very different sizes, such as pixels and coefficients of a rational lens, lose no digits.

SciPy warns where they do, and a warning is an error here.
"""

import numpy as np

from calib.solve.bundle.uncertainty import with_boards
from calib.solve.validation.inconsistent_shots.steadiness import of_focal

SIZES = np.array([1e3, 1.0, 1e-4, 1e-9, 1e2, 1.0])


def test_the_covariance_with_boards_is_that_of_the_sensors_where_nothing_changed() -> None:
    roots = np.random.default_rng(0).normal(size=(6, 9))
    covariance = roots @ roots.T * np.outer(SIZES, SIZES)
    np.testing.assert_allclose(with_boards(covariance, covariance[:4, :4]), covariance, rtol=1e-9)


def test_the_disagreement_about_a_focal_length_does_not_depend_on_the_units_of_the_others() -> None:
    random = np.random.default_rng(1)
    roots = random.normal(size=(9, 6, 9))
    information, scores = roots @ roots.transpose(0, 2, 1), random.normal(size=(9, 6))
    sizes = SIZES / SIZES[0]
    _, deviation = of_focal(information, np.eye(6), scores, np.eye(6)[0])
    _, scaled = of_focal(information / np.outer(sizes, sizes), np.diag(sizes**-2), scores / sizes, np.eye(6)[0])
    np.testing.assert_allclose(scaled, deviation, rtol=1e-6)

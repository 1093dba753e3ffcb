"""The fisheye of the kernels, in single precision and without arctangents, is that of the formula."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.lenses import forward
from calib.lenses.fisheye import KannalaBrandt
from tests import reference

#: Largest error of the angle: less than 1e-3 px of a camera with 1000 px per radian.
ANGLE_RAD = 5e-7

angles = st.floats(0, np.deg2rad(89))
turns = st.floats(-np.pi, np.pi)
coefficients = st.tuples(*[st.floats(-limit, limit) for limit in (0.1, 0.05, 0.02, 0.01)])


def ideal_of(theta: float, phi: float) -> np.ndarray:
    return (np.tan(theta) * np.array([np.cos(phi), np.sin(phi)])).astype(np.float32)


def test_the_angle_is_the_arctangent_of_the_radius():
    radius = np.concatenate([[0], np.geomspace(1e-7, 1e3, 2000)]).astype(np.float32)
    found = np.array([forward.angle_per_radius(one * one) for one in radius])
    np.testing.assert_allclose(found * radius.astype(float), np.arctan(radius.astype(float)), rtol=0, atol=ANGLE_RAD)


@settings(max_examples=200)
@given(angles, turns, coefficients)
def test_distortion_is_the_formula(theta, phi, k):
    (x, y), lens = ideal_of(theta, phi), np.array(k, np.float32)
    expected = reference.distort_fisheye(float(x), float(y), lens.astype(float))
    scale = 1 + sum(abs(one) * theta ** (2 * i) * (2 * i + 1) for i, one in enumerate(k, 1))
    np.testing.assert_allclose(forward.distort_fisheye(x, y, lens), expected, rtol=0, atol=2 * scale * ANGLE_RAD)


@settings(max_examples=200)
@given(st.floats(0, 1.2), turns, coefficients.map(lambda k: np.array(k, np.float32)), turns)
def test_a_small_step_is_undone_by_the_derivatives_of_the_formula(theta, phi, k, way):
    """On the axis too, where the formula divides zero by zero."""
    place, step = ideal_of(theta, phi), np.array([np.cos(way), np.sin(way)], np.float32)
    jacobian = KannalaBrandt(k.astype(float)).jacobian(place.astype(float))
    if np.linalg.det(jacobian) < 0.05:  # the fold of a lens, beyond which no image reaches
        return
    found = forward.undistort_step_fisheye(place[0], place[1], step[0], step[1], k)
    np.testing.assert_allclose(found, np.linalg.solve(jacobian, step), rtol=0, atol=2e-5 / np.linalg.det(jacobian))

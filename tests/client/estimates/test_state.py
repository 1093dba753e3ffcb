"""Arrays and names of an estimate."""

import numpy as np
import pytest
from abs_client.estimates.state import Status, received
from absmsg.v1.deformation_state_pb2 import DeformationState

from tests.client.messages import TRIANGLE, mesh, state, topology

SENSOR = DeformationState.Sensor(sensor="tof", visible=3, occluded=1, samples=2)


def test_arrays_have_their_shapes_and_units():
    entries = np.tile([1e-6, 0, 0, 4e-6, 0, 4e-6], (3, 1)).astype("<f4")
    given = received(state(1), mesh(1, covariance=entries.tobytes()), topology(), 0.02)
    np.testing.assert_array_equal(given.vertices, TRIANGLE)
    np.testing.assert_array_equal(given.undeformed, TRIANGLE)
    np.testing.assert_array_equal(given.faces, [[0, 1, 2]])
    np.testing.assert_allclose(given.sigma, [3e-3] * 3)
    np.testing.assert_allclose(given.vertex_covariance[1], np.diag([1e-6, 4e-6, 4e-6]))
    assert given.colors.shape == (0, 3)
    assert (given.status, given.usable, given.age_s, given.seq) == (Status.TRACKING, True, 0.02, 1)
    with pytest.raises(ValueError, match="read-only"):
        given.vertices[0] = 0


def test_the_covariance_of_theta_is_symmetric():
    message = state(1, theta=[1.0, 2.0], covariance=[4.0, 1.0, 9.0], covariance_valid=True)
    np.testing.assert_array_equal(received(message, mesh(1), topology(), 0).theta_covariance, [[4, 1], [1, 9]])


def test_what_is_not_known_is_nan():
    given = received(state(1, status=DeformationState.STATUS_LOST), mesh(1), topology(), 0)
    assert not given.usable
    assert np.isnan(given.sigma).all()
    assert np.isnan(given.theta_covariance).all()


def test_shares_and_sensors_have_every_field_of_the_message():
    given = received(state(1, inlier_share=0.9, sensors=[SENSOR]), mesh(1), topology(), 0)
    assert {f"{name}_share" for name in given.shares} == shares_in(DeformationState)
    assert {f"{name}_share" for name in given.sensor_shares["tof"]} == shares_in(DeformationState.Sensor)
    assert given.shares["inlier"] == 0.9
    assert (given.sensors["tof"].visible, given.sensors["tof"].occluded) == (3, 1)


def shares_in(message):
    return {field.name for field in message.DESCRIPTOR.fields if field.name.endswith("_share")}

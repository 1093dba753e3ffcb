"""Images of frames in SI units."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.frame import ENCODINGS, Frame, Geometry, Kind

DISTANCES = ("mono8", "mono16", "16UC1", "32FC1")


@given(st.integers(0, 2**32 - 1), st.sampled_from(DISTANCES), st.sampled_from([None, 0.0, 7.0, 255.0, 65535.0]))
def test_an_image_in_si_units_is_that_of_plain_numpy(seed, encoding, invalid):
    generator, dtype = np.random.default_rng(seed), ENCODINGS[encoding][0]
    data = generator.choice(np.array([0, 1, 7, 100, 255, 65535]), (5, 6)).astype(dtype)
    if dtype.kind == "f":
        data[generator.random((5, 6)) < 0.2] = np.nan
    scale = float(generator.uniform(1e-4, 10))
    frame = Frame("tof", "depth", Kind.DEPTH, data, encoding, 0, 0, 0, 0, scale, "m", Geometry.Z, invalid)
    expected = data.astype(np.float32) * np.float32(scale)
    if invalid is not None:
        expected[data == invalid] = np.nan
    np.testing.assert_array_equal(frame.si(), expected)
    assert frame.si().dtype == np.float32


def test_a_part_of_a_larger_image_is_converted_as_it_lies():
    data = np.arange(60, dtype="<u2").reshape(6, 10)[1:4, 2:9:2]
    frame = Frame("tof", "amplitude", Kind.AMPLITUDE, data, "16UC1", 0, 0, 0)
    assert frame.si() == pytest.approx(data)

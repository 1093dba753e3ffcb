"""Conversion of raw values to metres with the factory calibration, without loss."""

import dataclasses
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.kinect1.reference_plane import DEPTH_SCALE, CalibrationError, ReferencePlane, parse


def answers(*centimetres: float, shift: int = 200, size: int = 322) -> tuple[bytes, bytes]:
    fixed = bytearray(size)
    struct.pack_into("<4f", fixed, 94, *centimetres)
    return bytes(fixed), struct.pack("<HH", 0, shift)


@pytest.mark.parametrize(("raw", "millimetres"), [(400, 501), (600, 706), (800, 1194), (1000, 3864)])
def test_known_distances(raw: int, millimetres: float) -> None:
    # The raw values and distances that libfreenect's arithmetic gives for these numbers.
    assert ReferencePlane().z()[raw] * 1000 == pytest.approx(millimetres, abs=0.6)
    assert ReferencePlane().table()[raw] * DEPTH_SCALE * 1000 == pytest.approx(millimetres, abs=0.7)


def test_the_conversion_is_injective_up_to_13_metres() -> None:
    z, table = ReferencePlane().z(), ReferencePlane().table()
    seen = np.flatnonzero(table)
    assert z[seen].max() > 11
    assert len(np.unique(table[seen])) == len(seen)
    assert np.diff(z[seen]).min() > DEPTH_SCALE
    np.testing.assert_allclose(table[seen] * DEPTH_SCALE, z[seen], atol=DEPTH_SCALE / 2 + 1e-12)


def test_inverse_depths_are_spaced_by_the_step_of_the_noise_model() -> None:
    plane = ReferencePlane()
    with np.errstate(invalid="ignore"):
        steps = -np.diff(1 / plane.z()[:1089])
    np.testing.assert_allclose(steps, plane.step)
    assert plane.step == pytest.approx(2.85e-3, rel=0.02)


def test_no_return_and_values_beyond_infinity_are_invalid() -> None:
    table = ReferencePlane().table()
    assert table[2047] == 0
    assert not table[1090:].any()


def test_the_shift_maps_to_the_distance_of_the_reference_plane() -> None:
    plane = ReferencePlane(distance=1.5, shift=150)
    assert plane.z()[600] == pytest.approx(1.5, rel=2e-2)


def test_the_cameras() -> None:
    plane = ReferencePlane()
    depth, color = plane.depth_camera(), plane.color_camera()
    assert depth.fx == pytest.approx(575.8, abs=0.1)
    assert plane.depth_camera(488).height == 488
    np.testing.assert_allclose(color.T_rs[:3, 3], (0.023, 0, 0))


def test_the_calibration_is_parsed() -> None:
    plane = parse(*answers(7.4, 2.4, 121.0, 0.105, shift=199, size=334))
    expected = ReferencePlane(0.074, 0.024, 1.21, 0.00105, 199)
    assert dataclasses.astuple(plane) == pytest.approx(dataclasses.astuple(expected), rel=1e-6)


@pytest.mark.parametrize(
    "blocks",
    [
        answers(0, 0, 0, 0),
        answers(7.5, 2.3, float("nan"), 0.1),
        answers(7.5, 2.3, 120.0, 0.1, shift=0),
        (bytes(100), bytes(4)),
        (bytes(322), b""),
    ],
)
def test_an_implausible_calibration_raises(blocks: tuple[bytes, bytes]) -> None:
    with pytest.raises(CalibrationError, match="calibration"):
        parse(*blocks)


@given(st.binary(max_size=340), st.binary(max_size=12))
def test_arbitrary_answers_are_a_calibration_or_raise(fixed: bytes, shift: bytes) -> None:
    try:
        plane = parse(fixed, shift)
    except CalibrationError:
        return
    assert plane.table().dtype == np.uint16

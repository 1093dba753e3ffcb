"""The unpacking kernels agree with the bit-by-bit reference."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.kinect1 import unpacking
from evaluation.service.kinect1_emulation.bit_packing import pack, unpack

IDENTITY = np.arange(2048, dtype=np.uint16)


@given(st.binary(max_size=11 * 40))
def test_numbers_of_11_bits(packed: bytes) -> None:
    groups = len(packed) // 11
    result = np.full(8 * groups + 3, 9, np.uint16)
    unpacking.look_up_11(np.frombuffer(packed, np.uint8), IDENTITY, result)
    np.testing.assert_array_equal(result[: 8 * groups], unpack(packed[: 11 * groups], 11))
    np.testing.assert_array_equal(result[8 * groups :], 9)


@given(st.binary(max_size=5 * 80))
def test_numbers_of_10_bits(packed: bytes) -> None:
    groups = len(packed) // 5
    result = np.full(4 * groups + 3, 9, np.uint16)
    unpacking.unpack_10(np.frombuffer(packed, np.uint8), result)
    np.testing.assert_array_equal(result[: 4 * groups], unpack(packed[: 5 * groups], 10))
    np.testing.assert_array_equal(result[4 * groups :], 9)


def test_depth_is_looked_up_in_rows() -> None:
    raw = np.random.default_rng(3).integers(0, 2048, (480, 640))
    table = np.random.default_rng(4).integers(0, 65536, 2048).astype(np.uint16)
    packed = np.frombuffer(pack(raw, 11), np.uint8)
    np.testing.assert_array_equal(unpacking.depth(packed, table, 480, 640), table[raw])


def test_infrared_is_in_rows() -> None:
    raw = np.random.default_rng(5).integers(0, 1024, (488, 640))
    packed = np.frombuffer(pack(raw, 10), np.uint8)
    np.testing.assert_array_equal(unpacking.infrared(packed, 488, 640), raw)

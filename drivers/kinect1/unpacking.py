"""Unpacking of bit-packed pixels."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@kernel
def look_up_11(packed: NDArray[np.uint8], table: NDArray[np.uint16], result: NDArray[np.uint16]) -> None:
    """Unpacks 11-bit numbers v (eight in eleven bytes, most significant bit first) and writes `table[v]`.

    Args:
        packed: (11 n,).
        table: (2048,).
        result: (8 n,).
    """
    for i in range(min(packed.size // 11, result.size // 8)):
        # Eleven bytes as two overlapping words, since 88 bits do not fit into one.
        high = np.uint64(0)
        for k in range(8):
            high = (high << np.uint64(8)) | np.uint64(packed[11 * i + k])
        low = np.uint64(0)
        for k in range(3, 11):
            low = (low << np.uint64(8)) | np.uint64(packed[11 * i + k])
        for k in range(5):
            result[8 * i + k] = table[(high >> np.uint64(53 - 11 * k)) & np.uint64(2047)]
        for k in range(5, 8):
            result[8 * i + k] = table[(low >> np.uint64(77 - 11 * k)) & np.uint64(2047)]


@kernel
def unpack_10(packed: NDArray[np.uint8], result: NDArray[np.uint16]) -> None:
    """Unpacks 10-bit numbers, four in five bytes, most significant bit first.

    Args:
        packed: (5 n,).
        result: (4 n,).
    """
    for i in range(min(packed.size // 5, result.size // 4)):
        word = np.uint64(0)
        for k in range(5):
            word = (word << np.uint64(8)) | np.uint64(packed[5 * i + k])
        for k in range(4):
            result[4 * i + k] = (word >> np.uint64(30 - 10 * k)) & np.uint64(1023)


def depth(packed: NDArray[np.uint8], table: NDArray[np.uint16], height: int, width: int) -> NDArray[np.uint16]:
    """Looked-up 11-bit pixels, (height, width)."""
    result = np.zeros(height * width, np.uint16)
    look_up_11(packed, table, result)
    return result.reshape(height, width)


def infrared(packed: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint16]:
    """10-bit pixels, (height, width)."""
    result = np.zeros(height * width, np.uint16)
    unpack_10(packed, result)
    return result.reshape(height, width)

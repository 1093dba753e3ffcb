"""The inverse of what the driver does with pixels, bit by bit: the slow and obvious way."""

import numpy as np


def pack(values: np.ndarray, bits: int) -> bytes:
    """Numbers as a stream of `bits` each, most significant first."""
    words = (values.ravel().astype(np.uint16) << (16 - bits)).astype(">u2")
    return np.packbits(np.unpackbits(words.view(np.uint8).reshape(-1, 2), axis=1)[:, :bits]).tobytes()


def unpack(packed: bytes, bits: int) -> np.ndarray:
    """The numbers of such a stream, (n,); the reference of the driver's kernels."""
    stream = np.unpackbits(np.frombuffer(packed, np.uint8))
    whole = stream[: len(stream) // bits * bits].reshape(-1, bits).astype(int)
    return whole @ (1 << np.arange(bits - 1, -1, -1))

"""Reference implementation of bit packing and unpacking."""

import numpy as np


def pack(values: np.ndarray, bits: int) -> bytes:
    """Packs numbers of `bits` bits each, most significant first."""
    words = (values.ravel().astype(np.uint16) << (16 - bits)).astype(">u2")
    return np.packbits(np.unpackbits(words.view(np.uint8).reshape(-1, 2), axis=1)[:, :bits]).tobytes()


def unpack(packed: bytes, bits: int) -> np.ndarray:
    """Unpacks numbers (n,); reference of the driver's kernels."""
    stream = np.unpackbits(np.frombuffer(packed, np.uint8))
    whole = stream[: len(stream) // bits * bits].reshape(-1, bits).astype(int)
    return whole @ (1 << np.arange(bits - 1, -1, -1))

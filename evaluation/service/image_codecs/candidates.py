"""Codecs to compare; those whose packages are not installed are left out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import cv2
import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from drivers.encoding import pixel_filter

Pixels = NDArray[Any]


@dataclass(frozen=True)
class Candidate:
    """A lossless codec.

    Attributes:
        encode: compressed form of an image, and whatever else is needed.
        decode: the image, from that form and an image of the same shape and type.
        needs: package that has to be installed; "" if none.
        applies: whether it takes an image.
    """

    encode: Callable[[Pixels], Any]
    decode: Callable[[Any, Pixels], Pixels]
    needs: str = ""
    applies: Callable[[Pixels], bool] = lambda pixels: True


def available() -> tuple[dict[str, Candidate], list[str]]:
    """Candidates by name, and packages that are missing."""
    found, missing = {}, set()
    for name, candidate in CANDIDATES.items():
        try:
            if candidate.needs:
                import_module(candidate.needs)
            found[name] = candidate
        except ImportError:
            missing.add(candidate.needs)
    return found, sorted(missing)


def size(encoded: Any) -> int:
    """Bytes of what `Candidate.encode` returned."""
    return len(encoded[1] if isinstance(encoded, tuple) else encoded)


def _of_bytes(encode: Callable[[bytes], bytes], decode: Callable[[bytes], bytes], needs: str = "") -> Candidate:
    return Candidate(
        lambda pixels: encode(pixels.tobytes()),
        lambda data, like: np.frombuffer(decode(data), like.dtype).reshape(like.shape),
        needs,
    )


def _zstd(level: int) -> Candidate:
    compress = zstandard.ZstdCompressor(level=level).compress
    return _of_bytes(compress, zstandard.ZstdDecompressor().decompress)


def _shuffled(level: int) -> Candidate:
    """Differences from the left neighbour, byte planes, Zstandard."""
    plain = _zstd(level)

    def encode(pixels: Pixels) -> bytes:
        differences = pixels.copy()
        differences[:, 1:] -= pixels[:, :-1]
        return plain.encode(differences.view("u1").reshape(-1, pixels.itemsize).T)

    def decode(data: bytes, like: Pixels) -> Pixels:
        planes = plain.decode(data, np.empty((like.itemsize, like.size), "u1"))
        differences = np.ascontiguousarray(planes.T).view(like.dtype).reshape(like.shape)
        return np.cumsum(differences, axis=1, dtype=like.dtype)

    return Candidate(encode, decode)


def _png(level: int, strategy: int) -> Candidate:
    options = [cv2.IMWRITE_PNG_COMPRESSION, level, cv2.IMWRITE_PNG_STRATEGY, strategy]
    return Candidate(
        lambda pixels: cv2.imencode(".png", pixels, options)[1].tobytes(),
        lambda data, like: np.asarray(cv2.imdecode(np.frombuffer(data, "u1"), cv2.IMREAD_UNCHANGED)),
    )


def _imagecodecs(name: str, applies: Callable[[Pixels], bool] = lambda pixels: True, **options: Any) -> Candidate:
    def call(action: str) -> Callable[..., Any]:
        return getattr(import_module("imagecodecs"), f"{name}_{action}")

    return Candidate(
        lambda pixels: call("encode")(pixels, **options),
        lambda data, like: call("decode")(data),
        "imagecodecs",
        applies,
    )


def _rvl(pixels: bytes) -> bytes:
    return import_module("rvl").compress(pixels)


def _ours(mosaic: bool) -> Candidate:
    return Candidate(
        lambda pixels: pixel_filter.encode(pixels, mosaic),
        lambda made, like: pixel_filter.decode(made[1], made[0], like.shape, like.dtype, mosaic),
    )


CHOSEN = "filtered zstd (chosen)"

CANDIDATES: Mapping[str, Candidate] = {
    "lz4": _of_bytes(lz4.frame.compress, lz4.frame.decompress),
    **{f"zstd {level}": _zstd(level) for level in (-1, 1, 3)},
    **{f"delta + shuffle + zstd {level}": _shuffled(level) for level in (1, 3)},
    "RVL": Candidate(
        lambda pixels: _rvl(pixels.tobytes()),
        lambda data, like: np.frombuffer(import_module("rvl").decompress(data), like.dtype).reshape(like.shape),
        "rvl",
        lambda pixels: pixels.dtype.itemsize == 2,
    ),
    "PNG 1": _png(1, cv2.IMWRITE_PNG_STRATEGY_DEFAULT),
    "PNG 1, Huffman only": _png(1, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY),
    "PNG 1, run lengths": _png(1, cv2.IMWRITE_PNG_STRATEGY_RLE),
    "JPEG XL, effort 1": _imagecodecs("jpegxl", lossless=True, effort=1, numthreads=1),
    "JPEG-LS": _imagecodecs("jpegls"),
    "QOI": _imagecodecs("qoi", lambda pixels: pixels.ndim == 3),
    CHOSEN: _ours(mosaic=False),
}

#: Beside these, of Bayer mosaics.
CHOSEN_OF_MOSAICS = _ours(mosaic=True)

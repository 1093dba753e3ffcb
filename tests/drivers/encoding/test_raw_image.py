"""The wire format without copies, compared with the protobuf library."""

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from drivers.contract.frame import Frame, Kind
from drivers.encoding import codec, raw_image

NUMBERS = st.integers(0, 2**32 - 1)
IMAGES = st.builds(RawImage, width=NUMBERS, height=NUMBERS, step=NUMBERS, encoding=st.text(), frame_id=st.text())
PIXELS = hnp.arrays(np.uint8, hnp.array_shapes(max_dims=3, max_side=20))


def whole(image: RawImage, pixels: bytes) -> RawImage:
    """The message with its pixels, as the library has it."""
    copied = RawImage(data=pixels)
    copied.MergeFrom(image)
    return copied


@given(IMAGES, PIXELS, st.booleans())
def test_the_library_reads_what_is_serialized(image: RawImage, pixels: np.ndarray, turned: bool) -> None:
    pixels = pixels.T if turned else pixels
    assert RawImage.FromString(raw_image.serialize(image, pixels)) == whole(image, pixels.tobytes())


@given(st.lists(st.tuples(IMAGES, st.binary(max_size=300)), min_size=1, max_size=3))
def test_what_the_library_writes_is_read_and_the_last_field_counts(parts: list[tuple[RawImage, bytes]]) -> None:
    payload = b"".join(whole(image, pixels).SerializeToString() for image, pixels in parts)
    expected = RawImage.FromString(payload)
    image, pixels = raw_image.parse(payload)
    assert (pixels, image.data) == (expected.data, b"")
    assert whole(image, bytes(pixels)) == expected


def test_fields_that_are_not_known_are_kept() -> None:
    unknown = b"\xa0\x01\x07" + b"\xa9\x01" + bytes(8) + b"\xad\x01" + bytes(4)  # numbers 20 and 21, of three types
    payload = unknown + RawImage(width=3, data=b"ab").SerializeToString()
    image, pixels = raw_image.parse(payload)
    assert image.SerializeToString() == RawImage.FromString(unknown + b"\x15\x03\0\0\0").SerializeToString()
    assert pixels == b"ab"


@given(IMAGES, st.binary(min_size=1, max_size=300), st.data())
def test_what_is_cut_off_is_an_image_or_an_error_as_in_the_library(
    image: RawImage, pixels: bytes, data: st.DataObject
) -> None:
    payload = whole(image, pixels).SerializeToString()
    cut = payload[: data.draw(st.integers(0, len(payload)))]
    try:
        expected = RawImage.FromString(cut)
    except DecodeError:
        with pytest.raises(DecodeError):
            raw_image.parse(cut)
    else:
        assert whole(raw_image.parse(cut)[0], bytes(raw_image.parse(cut)[1])) == expected


@pytest.mark.parametrize("payload", [b"\xff" * 12, b"\x33", b"\x32\x05abc", b"\x32\x80"])
def test_malformed_bytes_are_errors(payload: bytes) -> None:
    with pytest.raises(DecodeError):
        raw_image.parse(payload)


def test_pixels_are_not_copied() -> None:
    frame = Frame("rgb", "color", Kind.COLOR, np.zeros((4, 5, 3), "u1"), "rgb8", 1, 2, 3)
    payload = codec.encode_image(frame, 1)
    decoded = codec.decode(payload, codec.encode_info(frame, Header())).data
    assert np.shares_memory(decoded, np.frombuffer(payload, np.uint8))


@pytest.mark.parametrize("length", range(4))
def test_numbers_are_aligned_wherever_they_begin(length: int) -> None:
    data = np.arange(6, dtype="<f4").reshape(2, 3)
    frame = Frame("x" * (1 + length), "ir", Kind.IR, data, "32FC1", 1, 2, 3)
    decoded = codec.decode(codec.encode_image(frame, 1), codec.encode_info(frame, Header())).data
    assert decoded.flags.aligned
    np.testing.assert_array_equal(decoded, data)

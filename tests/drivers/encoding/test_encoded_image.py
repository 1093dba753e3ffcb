"""Images of recordings: the published bytes return, or a CodecError names the problem."""

import numpy as np
import pytest
from absmsg.v1.encoded_image_pb2 import EncodedImage
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.frame import ENCODINGS
from drivers.encoding import codec, encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.encoding.parsing import CodecError
from tests.drivers.encoding.test_codec import frames, small_frame

LOSSLESS = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
JPEG = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.JPEG)


def published(encoding: str, height: int = 48, width: int = 64) -> bytes:
    dtype, channels = ENCODINGS[encoding]
    rows, columns = np.mgrid[:height, :width]
    levels = np.repeat((rows + columns)[..., None], channels, axis=2).astype(dtype) + np.arange(channels, dtype=dtype)
    step = width * channels * dtype.itemsize
    return RawImage(
        frame_id="head", width=width, height=height, encoding=encoding, step=step, data=levels.tobytes()
    ).SerializeToString()


def decoded(schema: str, payload: bytes) -> RawImage:
    return RawImage.FromString(encoded_image.decode(schema, payload))


@given(frames(), st.integers(0, 2**62))
def test_lossless_images_return_bit_for_bit(frame, wall_ns):
    image = codec.encode_image(frame, wall_ns)
    schema, payload = LOSSLESS(image)
    assert schema == encoded_image.ENCODED_SCHEMA
    assert decoded(schema, payload) == RawImage.FromString(image)


def test_smooth_images_take_a_fraction():
    for encoding in ENCODINGS:
        image = published(encoding)
        assert len(LOSSLESS(image)[1]) < len(image) / 4, encoding


@pytest.mark.parametrize(
    ("depth", "color", "schemas"),
    [
        ("raw", "raw", ["foxglove.RawImage"] * 3),
        ("lossless", "raw", ["absmsg.v1.EncodedImage", "foxglove.RawImage", "foxglove.RawImage"]),
        ("raw", "lossless", ["foxglove.RawImage", "absmsg.v1.EncodedImage", "absmsg.v1.EncodedImage"]),
        ("raw", "jpeg", ["foxglove.RawImage", "foxglove.CompressedImage", "absmsg.v1.EncodedImage"]),
    ],
)
def test_depth_and_color_have_codecs_of_their_own(depth, color, schemas):
    encode = encoded_image.encoder(ImageCodec(depth), ImageCodec(color))
    images = [published(encoding) for encoding in ("16UC1", "rgb8", "bayer_grbg8")]
    assert [encode(image)[0] for image in images] == schemas
    unchanged = [encode(image)[1] == image for image in images]
    assert unchanged == [schema == "foxglove.RawImage" for schema in schemas]


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_jpeg_keeps_colors_apart(encoding):
    image = RawImage(frame_id="head", width=32, height=16, encoding=encoding, step=96)
    image.data = np.tile(np.array([200, 100, 20], "u1"), (16, 32, 1)).tobytes()
    image.timestamp.FromNanoseconds(5)
    schema, payload = JPEG(image.SerializeToString())
    assert CompressedImage.FromString(payload).format == "jpeg"
    back = decoded(schema, payload)
    assert (back.encoding, back.frame_id, back.timestamp, back.step) == ("rgb8", "head", image.timestamp, 96)
    red_first = [200, 100, 20] if encoding == "rgb8" else [20, 100, 200]
    np.testing.assert_allclose(np.frombuffer(back.data, "u1").reshape(16, 32, 3)[8, 16], red_first, atol=3)


def test_what_other_programs_publish_is_kept():
    image = RawImage(frame_id="x", width=9, height=9, encoding="yuv422", step=1, data=b"abc").SerializeToString()
    schema, payload = LOSSLESS(image)
    assert EncodedImage.FromString(payload).codec == EncodedImage.CODEC_RAW
    assert decoded(schema, payload) == RawImage.FromString(image)


def test_bytes_that_are_no_image_are_refused():
    with pytest.raises(CodecError, match=r"are no foxglove\.RawImage"):
        LOSSLESS(b"\xff\xff")
    torn = RawImage(frame_id="x", width=9, height=9, encoding="rgb8", step=27, data=b"abc").SerializeToString()
    with pytest.raises(CodecError, match="x: 3 bytes are no 9 × 9 pixels"):
        JPEG(torn)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"codec": 0}, "codec 0 is none of"),
        ({"codec": 9}, "codec 9 is none of"),
        ({"predictor": 9}, "predictor 9 is none of"),
        ({"encoding": "yuv422"}, "encoding 'yuv422' is none of"),
        ({"width": 0}, "is empty or too large"),
        ({"width": 2**31, "height": 2**31}, "is empty or too large"),
        ({"height": 3}, "18 bytes of pixels are expected, not 12"),
        ({"data": b"\x00" * 30}, "are no compressed pixels"),
    ],
)
def test_errors_name_the_problem(changes, complaint):
    message = EncodedImage.FromString(LOSSLESS(codec.encode_image(small_frame(), 0))[1])
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(CodecError, match=complaint):
        encoded_image.decode(encoded_image.ENCODED_SCHEMA, message.SerializeToString())


@pytest.mark.parametrize("data", [b"", b"no image"])
def test_damaged_jpeg_is_refused(data):
    message = CompressedImage(frame_id="head", format="jpeg", data=data)
    with pytest.raises(CodecError, match=f"head: {len(data)} bytes are no jpeg image"):
        encoded_image.decode(encoded_image.JPEG_SCHEMA, message.SerializeToString())


@given(st.data())
def test_corrupt_bytes_are_an_image_or_a_codec_error(data):
    message = bytearray(LOSSLESS(codec.encode_image(small_frame(), 1))[1])
    for _ in range(data.draw(st.integers(1, 3))):
        message[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
    try:
        picture = decoded(encoded_image.ENCODED_SCHEMA, bytes(message))
    except CodecError:
        return
    assert isinstance(picture, RawImage)

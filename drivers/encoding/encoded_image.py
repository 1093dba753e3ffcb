"""Images in fewer bytes: `absmsg.v1.EncodedImage` without loss, `foxglove.CompressedImage` as JPEG.

The input is untrusted: decoding yields bytes of a `foxglove.RawImage` or a `CodecError` that names the problem.
"""

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from absmsg.v1.encoded_image_pb2 import EncodedImage
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from drivers.contract.frame import ENCODINGS
from drivers.encoding import codec, image_size, pixel_filter, raw_image
from drivers.encoding.message_check import MAX_IMAGE_BYTES
from drivers.encoding.parsing import CodecError, parse_message, pixels_of, shape_of
from drivers.encoding.pixel_filter import Filter, PixelFilterError, Predictor

ENCODED_SCHEMA = EncodedImage.DESCRIPTOR.full_name
JPEG_SCHEMA = CompressedImage.DESCRIPTOR.full_name

#: Full names of the messages that hold an image.
SCHEMAS = frozenset({codec.IMAGE_SCHEMA, ENCODED_SCHEMA, JPEG_SCHEMA})

#: Quality of JPEG images, of 100.
QUALITY = 95

#: From a serialized foxglove.RawImage to the full name of a message and that message.
ImageEncoder = Callable[[bytes], tuple[str, bytes]]


class ImageCodec(StrEnum):
    """Form of images in a recording."""

    RAW = "raw"
    LOSSLESS = "lossless"
    JPEG = "jpeg"


def unchanged(image: bytes) -> tuple[str, bytes]:
    """The image as it was published: an `ImageEncoder`."""
    return codec.IMAGE_SCHEMA, image


def encoder(depth: ImageCodec, color: ImageCodec) -> ImageEncoder:
    """An encoder that chooses by pixel encoding.

    Args:
        depth: codec of images with one channel: distances, amplitudes, infra-red.
        color: codec of colour images and of Bayer mosaics, of which JPEG makes lossless ones.
    """
    if depth == color == ImageCodec.RAW:
        return unchanged

    def encode(image: bytes) -> tuple[str, bytes]:
        picture = parse_message(RawImage, image)
        chosen = codec_of(picture.encoding, depth, color)
        if chosen == ImageCodec.RAW:
            return codec.IMAGE_SCHEMA, image
        if chosen == ImageCodec.JPEG:
            return JPEG_SCHEMA, _jpeg(picture).SerializeToString()
        return ENCODED_SCHEMA, _lossless(picture).SerializeToString()

    return encode


def codec_of(encoding: str, depth: ImageCodec, color: ImageCodec) -> ImageCodec:
    """Codec of images of a pixel encoding; arguments as of `encoder`."""
    if is_mosaic(encoding):
        return ImageCodec.LOSSLESS if color == ImageCodec.JPEG else color
    return color if encoding in _JPEG_COLORS else depth


def decode(schema: str, payload: bytes) -> bytes:
    """The serialized foxglove.RawImage of a message of one of `SCHEMAS`.

    Raises:
        CodecError: malformed or inconsistent message.
    """
    if schema == ENCODED_SCHEMA:
        message = parse_message(EncodedImage, payload)
        return raw_image.serialize(_without_pixels(message), _pixels(message))
    if schema == JPEG_SCHEMA:
        return _of_jpeg(parse_message(CompressedImage, payload))
    return payload


def is_mosaic(encoding: str) -> bool:
    """True if pixels of this encoding are those of a Bayer mosaic."""
    return encoding.startswith("bayer_")


def _lossless(picture: RawImage) -> EncodedImage:
    message = EncodedImage(
        timestamp=_stamp(picture),
        frame_id=picture.frame_id,
        width=picture.width,
        height=picture.height,
        encoding=picture.encoding,
        step=picture.step,
    )
    try:
        pixels = pixels_of(picture.frame_id, picture, picture.data)
    except CodecError:
        # Other programs can publish what we do not understand; it is kept as it is.
        message.codec, message.data = EncodedImage.CODEC_RAW, picture.data
        return message
    chosen, message.data = pixel_filter.encode(pixels, is_mosaic(picture.encoding))
    message.codec = EncodedImage.CODEC_FILTERED_ZSTD
    message.predictor = _PREDICTORS[chosen.predictor]
    message.green_subtracted = chosen.green_subtracted
    return message


def _without_pixels(message: EncodedImage) -> RawImage:
    return RawImage(
        timestamp=_stamp(message),
        frame_id=message.frame_id,
        width=message.width,
        height=message.height,
        encoding=message.encoding,
        step=message.step,
    )


def _pixels(message: EncodedImage) -> NDArray[Any]:
    """Pixels of a losslessly encoded image, as in its RawImage."""
    name = message.frame_id
    if message.codec == EncodedImage.CODEC_RAW:
        return np.frombuffer(message.data, "u1")
    if message.codec != EncodedImage.CODEC_FILTERED_ZSTD:
        raise CodecError(f"{name}: codec {message.codec} is none of {[1, 2]}; a newer version may read it")
    if message.predictor not in _PREDICTORS.values():
        raise CodecError(f"{name}: predictor {message.predictor} is none of {sorted(_PREDICTORS.values())}")
    if message.encoding not in ENCODINGS:
        raise CodecError(f"{name}: encoding {message.encoding!r} is none of {sorted(ENCODINGS)}")
    dtype, shape = ENCODINGS[message.encoding][0], shape_of(message)
    if not 0 < math.prod(shape) * dtype.itemsize <= MAX_IMAGE_BYTES:
        raise CodecError(f"{name}: an image of {message.width} × {message.height} pixels is empty or too large")
    chosen = Filter(Predictor(message.predictor), message.green_subtracted)
    try:
        return pixel_filter.decode(message.data, chosen, shape, dtype, is_mosaic(message.encoding))
    except PixelFilterError as error:
        raise CodecError(f"{name}: {error}") from error


def _stamp(message: RawImage | EncodedImage | CompressedImage) -> Timestamp | None:
    return message.timestamp if message.HasField("timestamp") else None


def _jpeg(picture: RawImage) -> CompressedImage:
    try:
        pixels = pixels_of(picture.frame_id, picture, picture.data)
    except CodecError as error:
        size = f"{picture.width} × {picture.height}"
        raise CodecError(f"{picture.frame_id}: {len(picture.data)} bytes are no {size} pixels") from error
    ordered = _JPEG_COLORS[picture.encoding](pixels)
    data = cv2.imencode(".jpg", ordered, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
    return CompressedImage(timestamp=_stamp(picture), frame_id=picture.frame_id, data=data, format="jpeg")


def _of_jpeg(message: CompressedImage) -> bytes:
    """The serialized RawImage of a colour image, whatever the order of the channels was."""
    try:
        pixels = image_size.decoded(message.data, cv2.IMREAD_COLOR_RGB)
    except image_size.ImageSizeError as error:
        kind = message.format or "compressed"
        raise CodecError(f"{message.frame_id}: {len(message.data)} bytes are no {kind} image: {error}") from error
    height, width = pixels.shape[:2]
    image = RawImage(
        timestamp=_stamp(message),
        frame_id=message.frame_id,
        width=width,
        height=height,
        encoding="rgb8",
        step=3 * width,
    )
    return raw_image.serialize(image, pixels)


def _of_rgb(pixels: NDArray[Any]) -> NDArray[Any]:
    return cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)


#: OpenCV's order of the channels, from the encodings that JPEG can hold.
_JPEG_COLORS: Mapping[str, Callable[[NDArray[Any]], NDArray[Any]]] = {
    "rgb8": _of_rgb,
    "bgr8": lambda pixels: pixels,
}

_PREDICTORS: Mapping[Predictor, EncodedImage.Predictor] = {
    Predictor.NONE: EncodedImage.PREDICTOR_NONE,
    Predictor.LEFT: EncodedImage.PREDICTOR_LEFT,
    Predictor.ABOVE: EncodedImage.PREDICTOR_ABOVE,
    Predictor.GRADIENT: EncodedImage.PREDICTOR_GRADIENT,
}

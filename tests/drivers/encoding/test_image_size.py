import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.within import load_mask
from drivers.encoding import encoded_image, image_size
from drivers.encoding.parsing import CodecError
from drivers.image_folder import image_file
from drivers.image_folder.listing import ImageFolderError


def part(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int) -> bytes:
    """A header that claims a size, and no pixels."""
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", header) + part(b"IDAT", zlib.compress(b"")) + part(b"IEND", b"")


def jpeg(width: int, height: int) -> bytes:
    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    begin = data.index(b"\xff\xc0") + 5
    data[begin : begin + 4] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff", ".pgm", ".bmp", ".webp"])
def test_images_of_every_format_pass(suffix: str) -> None:
    encoded = cv2.imencode(suffix, np.zeros((20, 30), np.uint8))[1]
    image_size.check(encoded.tobytes())
    decoded = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE)
    assert decoded is not None
    assert decoded.shape == (20, 30)


def test_a_chunk_that_announces_more_bytes_than_there_are_is_refused_before_there_is_room_for_it(
    tmp_path: Path,
) -> None:
    content = bytearray(cv2.imencode(".png", np.zeros((20, 30), np.uint8))[1].tobytes())
    assert not image_size.is_cut_off(bytes(content))
    begin = content.index(b"IDAT") - 4
    content[begin : begin + 4] = struct.pack(">I", 2**31 - 1)
    (tmp_path / "x.png").write_bytes(content)
    with pytest.raises(ImageFolderError, match=r"x\.png: the image is truncated"):
        image_file.read(tmp_path / "x.png")
    with pytest.raises(image_size.ImageSizeError, match="a part of it is missing"):  # of the bus and of recordings, too
        image_size.check(bytes(content))


@pytest.mark.parametrize(
    "content", [png(30_000, 30_000), png(10_000, 10_000), jpeg(30_000, 30_000), png(2**31 - 1, 2**31 - 1)]
)
def test_an_image_that_claims_too_many_pixels_is_refused_before_it_is_decoded(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "x.png").write_bytes(content)
    with pytest.raises(ImageFolderError, match=r"x\.png: .*67108864"):
        image_file.read(tmp_path / "x.png")
    with pytest.raises(DetectionError, match=r"within = .*67108864"):
        load_mask(tmp_path / "x.png", "within")
    message = CompressedImage(frame_id="head", format="jpeg", data=content)
    with pytest.raises(CodecError, match=r"head: .*67108864"):
        encoded_image.decode(encoded_image.JPEG_SCHEMA, message.SerializeToString())

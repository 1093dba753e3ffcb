import struct

import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk, Message

from drivers.encoding import mcap_chunk
from drivers.encoding.mcap_chunk import ChunkSizeError

RECORD = b"\x05" + struct.pack("<QHIQQ", 22 + 3, 1, 2, 3, 4) + b"abc"
COMPRESS = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstandard.compress}


def chunk(compression: str, data: bytes, size: int) -> Chunk:
    return Chunk(compression, data, 0, 0, 0, size)


@pytest.mark.parametrize("compression", COMPRESS)
def test_the_records_of_a_chunk_come_back(compression: str) -> None:
    (message,) = mcap_chunk.records(chunk(compression, COMPRESS[compression](RECORD), len(RECORD)))
    assert isinstance(message, Message)
    assert message.data == b"abc"


@pytest.mark.parametrize("compression", COMPRESS)
@pytest.mark.parametrize("size", [0, 10, 1 << 20, 1 << 40])
def test_a_chunk_of_another_size_than_it_claims_is_refused(compression: str, size: int) -> None:
    with pytest.raises((ChunkSizeError, zstandard.ZstdError)):
        mcap_chunk.records(chunk(compression, COMPRESS[compression](RECORD * 100), size))


def test_a_frame_that_claims_to_be_huge_is_refused_before_memory_is_reserved() -> None:
    frame = b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 1 << 44) + b"\x01\x00\x00"
    assert zstandard.frame_content_size(frame) == 1 << 44
    with pytest.raises(ChunkSizeError):
        mcap_chunk.records(chunk("zstd", frame, 100))

"""Records of MCAP chunks, of limited size: a chunk of a kilobyte can claim, or decompress to, many gigabytes."""

from dataclasses import replace

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import breakup_chunk

from drivers.encoding.message_check import MAX_IMAGE_BYTES

#: Largest chunk, decompressed: the recorder's hold a megabyte, or one image that is larger [bytes].
MAX_CHUNK_BYTES = MAX_IMAGE_BYTES + (1 << 24)


class ChunkSizeError(McapError):
    """A chunk that is too large, or does not have the size that it claims."""


def records(chunk: Chunk) -> list[McapRecord]:
    """The records in a chunk, whose checksum is verified.

    Raises:
        ChunkSizeError: see there.
        Exception: whatever decompressors and the library make of damaged bytes; see `drivers.replay.contents.DAMAGE`.
    """
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise ChunkSizeError(f"a chunk of {chunk.uncompressed_size} bytes, {MAX_CHUNK_BYTES} are allowed")
    data = _decompressed(chunk)
    if len(data) != chunk.uncompressed_size:
        raise ChunkSizeError(f"a chunk has other than the {chunk.uncompressed_size} bytes that it claims")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def _decompressed(chunk: Chunk) -> bytes:
    """Content of a chunk, cut at one byte more than it claims."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) not in (size, -1):  # for which memory would be reserved
            raise ChunkSizeError(f"a frame claims to have other than the {size} bytes that its chunk claims")
        return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)
    if chunk.compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    return chunk.data

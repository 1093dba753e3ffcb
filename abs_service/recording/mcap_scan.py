"""Reads the records of an MCAP file that may be damaged anywhere."""

import mmap
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

_PREFIX = struct.Struct("<BQ")  # opcode, length of what follows
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size and checksum, length of the compression's name
_COMPRESSIONS = (b"", b"lz4", b"zstd")
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
#: A chunk that claims to hold more is damaged [bytes].
_LARGEST_CHUNK = 1 << 30


Data = bytes | mmap.mmap


class RecordScanner:
    """Iterates over the records outside of chunks; chunks come whole, see `open_chunk`.

    Damage inside of a record is found by its checksum and leaves the others alone. Where the lengths of records are
    wrong, so that nobody knows where the next one begins, the next chunk is searched for.

    Attributes:
        damaged: records left out because they contradict themselves.
        skipped_bytes: bytes that are no record, such as a torn end.
    """

    def __init__(self, data: Data) -> None:
        self.damaged = 0
        self.skipped_bytes = 0
        self._data = data

    def __iter__(self) -> Iterator[McapRecord]:
        position = len(MCAP0_MAGIC) if self._data[0 : len(MCAP0_MAGIC)] == MCAP0_MAGIC else 0
        certain = position  # everything up to here is what it seems to be
        while position < len(self._data):
            if self._data[position : position + len(MCAP0_MAGIC)] == MCAP0_MAGIC:
                position += len(MCAP0_MAGIC)  # the end of a finished file
                continue
            end = self._end(position)
            if end is None:
                # A record before may have lied about its length, so the search begins behind the last certain one.
                found = find_chunk(self._data, certain)
                self.skipped_bytes += max(found - position, 1)
                position = certain = found
                continue
            opcode = self._data[position : position + 1][0]
            yield from self._parse(opcode, self._data[position + _PREFIX.size : end])
            position = end
            if opcode == Opcode.CHUNK:
                certain = end

    def open_chunk(self, chunk: Chunk) -> list[McapRecord]:
        """The records in a chunk; none, and counted, if the chunk is damaged."""
        if chunk.uncompressed_size > _LARGEST_CHUNK:
            self.damaged += 1
            return []
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except Exception:  # whatever a decompressor or parser makes of damaged bytes
            self.damaged += 1
            return []

    def _end(self, position: int) -> int | None:
        """Where the record at `position` ends; None if there is no whole record."""
        if position + _PREFIX.size > len(self._data):
            return None
        opcode, length = _PREFIX.unpack(self._data[position : position + _PREFIX.size])
        end = position + _PREFIX.size + length
        if opcode not in _OPCODES or end > len(self._data):
            return None
        if opcode == Opcode.CHUNK and not _is_chunk(self._data, position):
            return None
        return end

    def _parse(self, opcode: int, content: bytes) -> Iterator[McapRecord]:
        readers = {
            Opcode.ATTACHMENT: Attachment.read,
            Opcode.CHANNEL: Channel.read,
            Opcode.CHUNK: Chunk.read,
            Opcode.METADATA: Metadata.read,
            Opcode.SCHEMA: Schema.read,
        }
        try:
            if opcode == Opcode.MESSAGE:
                yield Message.read(ReadDataStream(BytesIO(content)), len(content))
            elif opcode in readers and _is_intact(opcode, content):
                yield readers[Opcode(opcode)](ReadDataStream(BytesIO(content)))
            elif opcode in readers:
                self.damaged += 1
        except Exception:  # whatever the parser makes of damaged bytes
            self.damaged += 1


def find_chunk(data: Data, start: int) -> int:
    """Where the first chunk at or behind `start` begins; the length of `data` if there is none."""
    position = data.find(bytes([Opcode.CHUNK]), start)
    while position >= 0:
        if _is_chunk(data, position):
            return position
        position = data.find(bytes([Opcode.CHUNK]), position + 1)
    return len(data)


def _is_chunk(data: Data, position: int) -> bool:
    """Whether the lengths in what may be a chunk agree with each other; chance would hardly make them."""
    head = data[position : position + _PREFIX.size + _CHUNK.size]
    if len(head) < _PREFIX.size + _CHUNK.size or head[0] != Opcode.CHUNK:
        return False
    _, length = _PREFIX.unpack_from(head)
    *_, name_length = _CHUNK.unpack_from(head, _PREFIX.size)
    start = position + len(head)
    if name_length > max(map(len, _COMPRESSIONS)) or data[start : start + name_length] not in _COMPRESSIONS:
        return False
    size = data[start + name_length : start + name_length + 8]
    end = position + _PREFIX.size + length
    return len(size) == 8 and end <= len(data) and start + name_length + 8 + int.from_bytes(size, "little") == end


def _is_intact(opcode: int, content: bytes) -> bool:
    if opcode != Opcode.ATTACHMENT:
        return True  # chunks have their checksum inside, the others have none
    checksum = int.from_bytes(content[-4:], "little")
    return checksum in (0, zlib.crc32(content[:-4]))

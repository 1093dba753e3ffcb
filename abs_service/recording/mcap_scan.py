"""Scans the records of a damaged MCAP file, where the library's reader would stop at the first error."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from abs_service.recording.disk.file_bytes import FileBytes
from drivers.encoding import mcap_chunk

_PREFIX = struct.Struct("<BQ")  # opcode, length of what follows
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size and checksum, length of the compression's name
_COMPRESSIONS = (b"", b"lz4", b"zstd")
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
_COPIED = frozenset({Opcode.ATTACHMENT, Opcode.CHANNEL, Opcode.CHUNK, Opcode.MESSAGE, Opcode.METADATA, Opcode.SCHEMA})


Data = bytes | FileBytes


class RecordScanner:
    """Iterates over the records outside of chunks; chunks come whole, see `open_chunk`.

    Damage inside of a record is found by its checksum. After a damaged length, scanning resumes at the next chunk.

    Attributes:
        damaged: records left out because they are malformed.
        skipped_bytes: bytes that are no record, such as a torn end.
    """

    def __init__(self, data: Data) -> None:
        self.damaged = 0
        self.skipped_bytes = 0
        self._data = data

    def __iter__(self) -> Iterator[McapRecord]:
        position = len(MCAP0_MAGIC) if self._data[0 : len(MCAP0_MAGIC)] == MCAP0_MAGIC else 0
        verified = position  # verified up to here
        while position < len(self._data):
            if self._data[position : position + len(MCAP0_MAGIC)] == MCAP0_MAGIC:
                position += len(MCAP0_MAGIC)  # the end of a finished file
                continue
            end = self._end(position)
            if end is None:
                # An earlier record may have a wrong length, so the search begins after the last verified one.
                found = find_chunk(self._data, verified)
                self.skipped_bytes += max(found - position, 1)
                position = verified = found
                continue
            opcode = self._data[position : position + 1][0]
            yield from self._parse(opcode, self._data[position:end])
            position = end
            if opcode == Opcode.CHUNK:
                verified = end

    def open_chunk(self, chunk: Chunk) -> list[McapRecord]:
        """The records in a chunk; none, and counted, if the chunk is damaged."""
        try:
            return mcap_chunk.records(chunk)
        except Exception:  # whatever a decompressor or parser makes of damaged bytes
            self.damaged += 1
            return []

    def _end(self, position: int) -> int | None:
        """End of the record at `position`; None if there is no complete record."""
        if position + _PREFIX.size > len(self._data):
            return None
        opcode, length = _PREFIX.unpack(self._data[position : position + _PREFIX.size])
        end = position + _PREFIX.size + length
        if opcode not in _OPCODES or end > len(self._data):
            return None
        if opcode == Opcode.CHUNK and not _is_chunk(self._data, position):
            return None
        return end

    def _parse(self, opcode: int, record: bytes) -> Iterator[McapRecord]:
        """The record, from its opcode to its end, if it is of a kind that is copied and intact."""
        if opcode not in _COPIED:
            return
        if not _is_intact(opcode, record):
            self.damaged += 1
            return
        try:
            yield next(StreamReader(BytesIO(record), skip_magic=True, emit_chunks=True).records)
        except Exception:  # whatever the parser makes of damaged bytes
            self.damaged += 1


def find_chunk(data: Data, start: int) -> int:
    """Position of the first chunk at or after `start`; the length of `data` if there is none."""
    position = data.find(bytes([Opcode.CHUNK]), start)
    while position >= 0:
        if _is_chunk(data, position):
            return position
        position = data.find(bytes([Opcode.CHUNK]), position + 1)
    return len(data)


def _is_chunk(data: Data, position: int) -> bool:
    """True if the lengths in the header of a possible chunk are consistent, which random bytes hardly are."""
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


def _is_intact(opcode: int, record: bytes) -> bool:
    if opcode != Opcode.ATTACHMENT:
        return True  # chunks have their checksum inside, the others have none
    checksum = int.from_bytes(record[-4:], "little")
    return checksum in (0, zlib.crc32(record[_PREFIX.size : -4]))

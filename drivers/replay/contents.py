"""Index of an MCAP file: from its summary section or, for an unfinished file, by a sequential scan."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, Footer, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from zstandard import ZstdError

from calib.files import limited
from drivers.contract.device import DeviceError
from drivers.encoding import mcap_chunk

#: Exceptions of the MCAP reader and its decompressors for truncated or corrupt bytes.
DAMAGE = (
    *(McapError, ZstdError, EOFError, RuntimeError, ValueError, struct.error),
    *(KeyError, MemoryError, OverflowError),  # a channel that is nowhere defined, a record that claims to be huge
)

#: Bytes of opcode and length before the content of a record.
_RECORD_HEADER = 9


class RecordingError(DeviceError):
    """A file that cannot be replayed; names the file and the problem."""


@dataclass(frozen=True)
class ChunkLocation:
    """A chunk of a file.

    Attributes:
        offset: in the file.
        start_ns, end_ns: first and last log time [ns].
        channels: that it has messages of; None if unknown.
    """

    offset: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None = None

    def may_have(self, channels: Set[int]) -> bool:
        """False if it has no message of any of these channels."""
        return self.channels is None or not self.channels.isdisjoint(channels)


@dataclass(frozen=True)
class Topic:
    """One topic: name, full name of its protobuf message, and number of messages."""

    name: str
    schema: str
    count: int


@dataclass(frozen=True)
class Contents:
    """Contents of one file.

    Attributes:
        chunks: in file order.
        topics: by channel id.
        attachments: content by name.
        start_ns, end_ns: first and last log time [ns]; 0 for a file without messages.
        truncated: True if the file was not finished: its writer was killed, or is still writing.
        damaged: number of corrupt chunks that were skipped; in a file with an index they are only detected when read.
    """

    chunks: tuple[ChunkLocation, ...]
    topics: Mapping[int, Topic]
    attachments: Mapping[str, bytes]
    start_ns: int
    end_ns: int
    truncated: bool
    damaged: int


def scan(path: Path) -> Contents:
    """Reads the contents of a file, fast if it has an index.

    Raises:
        RecordingError: the file cannot be read, is not MCAP, or has a damaged attachment.
    """
    try:
        with limited.opened(path) as stream:
            summary = _summary(path, stream)
            return _scan_records(path, stream) if summary is None else _from_index(summary, stream)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
    except DAMAGE as error:
        what = f"{path}: an attachment is damaged ({type(error).__name__} {error})"
        raise RecordingError(f"{what}; `abs-service recover` saves the rest") from error


def read_chunk(stream: BinaryIO, place: ChunkLocation) -> list[McapRecord]:
    """The records of a chunk; raises one of `DAMAGE` if it is corrupt."""
    stream.seek(place.offset + _RECORD_HEADER)
    return mcap_chunk.records(Chunk.read(ReadDataStream(stream)))


def _summary(path: Path, stream: BinaryIO) -> Summary | None:
    """The summary section at the end of the file, None if there is none."""
    try:
        reader = SeekingReader(stream)
    except DAMAGE as error:
        what = f"{path}: this is no MCAP file ({stream.seek(0, 2)} bytes), or its beginning is damaged"
        remedy = "`abs-service recover` saves what can be read, `abs-service import` reads recordings of other tools"
        raise RecordingError(f"{what}; {remedy}") from error
    try:
        summary = reader.get_summary()
    except (*DAMAGE, OSError):  # the latter if the file is shorter than the end of a finished one
        return None
    return summary if summary is not None and _is_whole(summary) else None


def _is_whole(summary: Summary) -> bool:
    """False if it lacks a part that is used here; a writer may leave out any."""
    statistics = summary.statistics
    return (
        statistics is not None
        and 0 < statistics.chunk_count == len(summary.chunk_indexes)
        and statistics.attachment_count == len(summary.attachment_indexes)
    )


def _from_index(summary: Summary, stream: BinaryIO) -> Contents:
    counts = summary.statistics.channel_message_counts if summary.statistics else {}
    stream.seek(0)
    return Contents(
        chunks=tuple(
            ChunkLocation(one.chunk_start_offset, one.message_start_time, one.message_end_time, _channels(one))
            for one in summary.chunk_indexes
        ),
        topics=_topics(summary.schemas, summary.channels, counts),
        attachments={attachment.name: attachment.data for attachment in SeekingReader(stream).iter_attachments()},
        start_ns=min((index.message_start_time for index in summary.chunk_indexes), default=0),
        end_ns=max((index.message_end_time for index in summary.chunk_indexes), default=0),
        truncated=False,
        damaged=0,
    )


def _channels(index: ChunkIndex) -> frozenset[int] | None:
    """Channels with messages in a chunk; None for a writer that lists none."""
    return frozenset(index.message_index_offsets) or None


def _scan_records(path: Path, stream: BinaryIO) -> Contents:
    """Reads every record up to the first truncated one; corrupt chunks are skipped and counted."""
    damaged, finished = 0, False
    chunks: list[ChunkLocation] = []
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    counts: Counter[int] = Counter()
    attachments: dict[str, bytes] = {}
    times: list[int] = []
    for offset, record in _records(stream):
        if isinstance(record, Attachment):
            attachments[record.name] = record.data
        if isinstance(record, Message):
            raise RecordingError(
                f"{path}: it has messages outside of chunks; `abs-service recover` writes a file without"
            )
        finished = isinstance(record, Footer)
        if not isinstance(record, Chunk):
            continue
        try:
            contents = mcap_chunk.records(record)
        except DAMAGE:
            damaged += 1
            continue
        chunks.append(ChunkLocation(offset, record.message_start_time, record.message_end_time))
        times += [record.message_start_time, record.message_end_time]
        schemas |= {schema.id: schema for schema in contents if isinstance(schema, Schema)}
        channels |= {channel.id: channel for channel in contents if isinstance(channel, Channel)}
        counts.update(message.channel_id for message in contents if isinstance(message, Message))
    topics = _topics(schemas, channels, counts)
    return Contents(
        tuple(chunks),
        topics,
        attachments,
        min(times, default=0),
        max(times, default=0),
        truncated=not finished,
        damaged=damaged,
    )


def _records(stream: BinaryIO) -> Iterator[tuple[int, McapRecord]]:
    """Offset and content of every record up to the truncation."""
    stream.seek(0)
    records = StreamReader(stream, emit_chunks=True).records
    offset = len(b"\x89MCAP0\r\n")
    try:
        for record in records:
            yield offset, record
            offset = stream.tell()
    except DAMAGE:
        return


def _topics(
    schemas: Mapping[int, Schema], channels: Mapping[int, Channel], counts: Mapping[int, int]
) -> dict[int, Topic]:
    return {
        channel.id: Topic(
            channel.topic,
            schemas[channel.schema_id].name if channel.schema_id in schemas else "",
            counts.get(channel.id, 0),
        )
        for channel in channels.values()
    }

"""Messages of an MCAP file in order of time."""

import heapq
import os
from collections.abc import Iterator, Sequence, Set
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Message

from drivers.replay.contents import DAMAGE, ChunkLocation, Contents, RecordingError, Topic, read_chunk

#: Largest time [ns].
LAST_NS = (1 << 63) - 1

#: Bytes that the disk reads ahead, so that no reader waits while others use the disk.
AHEAD = 32 << 20


def messages(path: Path, contents: Contents, schemas: Set[str]) -> Iterator[tuple[Topic, Message]]:
    """Messages of the given schemas by log time; ties in the order in which they were written.

    Args:
        path: of the file.
        contents: its index.
        schemas: full names of protobuf messages; chunks without any of them are not read.

    Raises:
        RecordingError: a corrupt chunk.
    """
    wanted = {channel for channel, topic in contents.topics.items() if topic.schema in schemas}
    # A message can be yielded as soon as no unread chunk starts earlier.
    starts = np.array([*(min(chunk.start_ns, LAST_NS) for chunk in contents.chunks), LAST_NS], np.int64)
    earliest = np.minimum.accumulate(starts[::-1])[::-1]
    held: list[tuple[int, int, int, Message]] = []
    with path.open("rb") as stream:
        begun = 0
        for number, chunk in enumerate(contents.chunks):
            begun = _read_ahead(stream, contents.chunks, wanted, begun, chunk.offset + AHEAD)
            try:
                records = read_chunk(stream, chunk) if chunk.may_have(wanted) else []
            except DAMAGE as error:
                where = f"{path}: the chunk at byte {chunk.offset} is damaged ({error})"
                raise RecordingError(f"{where}; `abs-service recover` saves the rest") from error
            for position, record in enumerate(records):
                if isinstance(record, Message) and record.channel_id in wanted:
                    heapq.heappush(held, (record.log_time, number, position, record))
            while held and held[0][0] <= earliest[number + 1]:
                message = heapq.heappop(held)[-1]
                yield contents.topics[message.channel_id], message


def _read_ahead(stream: BinaryIO, chunks: Sequence[ChunkLocation], wanted: Set[int], begun: int, end: int) -> int:
    """Lets the disk begin to read chunks with wanted channels, from number `begun` up to a byte; the next number."""
    while begun + 1 < len(chunks) and chunks[begun].offset < end:
        if chunks[begun].may_have(wanted):
            size = max(chunks[begun + 1].offset - chunks[begun].offset, 1)  # other writers may order them otherwise
            os.posix_fadvise(stream.fileno(), chunks[begun].offset, size, os.POSIX_FADV_WILLNEED)
        begun += 1
    return begun

"""One MCAP file being written: topics and protobuf schemas appear in it as soon as they are first used."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import BinaryIO

from absmsg.v1 import (  # noqa: F401
    deformation_state_pb2,
    deformed_mesh_pb2,
    frame_info_pb2,
    health_pb2,
    sensor_model_pb2,
    surface_truth_pb2,
)

# Importing a message module enters its schema into the default descriptor pool, where `write` looks names up.
from foxglove_schemas_protobuf import CameraCalibration_pb2, FrameTransforms_pb2, RawImage_pb2  # noqa: F401
from google.protobuf import descriptor_pool
from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

#: Uncompressed bytes after which a chunk is closed; what a reader must decompress to reach one message. Four times
#: as many cost the recorder twice the time, since such buffers come from the system anew for every chunk.
CHUNK_SIZE = 1 << 20

#: Name of the metadata records that repeat what each channel is: its id, topic and schema.
CHANNEL_METADATA = "abs.channel"


class Compression(StrEnum):
    """How chunks are compressed; `LZ4` costs half the time of `ZSTD` and saves half as much."""

    NONE = "none"
    LZ4 = "lz4"
    ZSTD = "zstd"


_COMPRESSION = {
    Compression.NONE: CompressionType.NONE,
    Compression.LZ4: CompressionType.LZ4,
    Compression.ZSTD: CompressionType.ZSTD,
}


class McapFileError(Exception):
    """A message that cannot be written as asked, or a file that an earlier error has already spoiled."""


class McapFile:
    """Writes protobuf messages, unchanged, to an MCAP stream.

    The first `OSError` (a full disk, say) spoils the file for good: it is re-raised, and every later call raises
    `McapFileError`. A writer that went on would leave a file that looks complete and is corrupt.

    Args:
        stream: binary stream opened for writing, positioned at its beginning; stays the caller's to close.
        compression: of the chunks.
        chunk_size: uncompressed bytes per chunk.
    """

    def __init__(
        self, stream: BinaryIO, compression: Compression = Compression.ZSTD, chunk_size: int = CHUNK_SIZE
    ) -> None:
        self._stream = stream
        self._writer = Writer(stream, chunk_size=chunk_size, compression=_COMPRESSION[compression])
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[str, int]] = {}
        self._spoiled = ""
        self._writer.start(profile="", library="abs-service")

    def write(self, topic: str, schema_name: str, payload: bytes, log_time_ns: int, sequence: int) -> None:
        """Appends one message.

        Args:
            topic: MCAP topic, `/sensor/stream/image`, say; carries one schema only.
            schema_name: full name of the protobuf message, `absmsg.v1.FrameInfo`, say.
            payload: the serialized message, written as it is.
            log_time_ns: wall-clock time of what the message tells of [ns]; log and publish time in the file.
            sequence: the sender's counter; its lower 32 bits are stored.

        Raises:
            McapFileError: unknown schema name, a second schema on the topic, or a spoiled file.
            OSError: the stream does not take the data; the file is spoiled.
        """
        channel = self._channel(topic, schema_name)
        self._attempt(
            lambda: self._writer.add_message(channel, log_time_ns, payload, log_time_ns, sequence & 0xFFFFFFFF)
        )

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Adds an attachment; attached at the beginning, it survives a later crash. Raises as `write` does."""
        self._attempt(lambda: self._writer.add_attachment(time_ns, time_ns, name, media_type, data))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Adds a metadata record. Raises as `write` does."""
        self._attempt(lambda: self._writer.add_metadata(name, dict(values)))

    def flush(self) -> None:
        """Closes the open chunk and hands everything to the operating system. Raises as `write` does.

        Chunks close by size only, so that a quiet topic would stay in memory for a minute without it. What was
        written before a flush can be read back after this process was killed; call it once a second.
        """
        self._attempt(self._writer.flush)

    def finish(self) -> None:
        """Writes index and footer, and flushes the stream. Raises as `write` does."""
        self._attempt(self._writer.finish)
        self._attempt(self._stream.flush)

    def _attempt(self, action: Callable[[], None]) -> None:
        if self._spoiled:
            raise McapFileError(f"an earlier write failed ({self._spoiled}); start a new file")
        try:
            action()
        except OSError as error:
            self._spoiled = str(error)
            raise

    def _channel(self, topic: str, schema_name: str) -> int:
        known, channel = self._channels.get(topic, (schema_name, 0))
        if known != schema_name:
            raise McapFileError(f"topic {topic} carries {known}, not {schema_name}")
        if channel == 0:
            channel = self._writer.register_channel(topic, MessageEncoding.Protobuf, self._schema(schema_name))
            self._channels[topic] = (schema_name, channel)
            # Until the file is finished, only one chunk says what the channel is. If that one is damaged, this helps.
            self.describe(CHANNEL_METADATA, {"id": str(channel), "topic": topic, "schema": schema_name})
        return channel

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.Protobuf, file_descriptor_set(name))
        return self._schemas[name]


def file_descriptor_set(schema_name: str) -> bytes:
    """Serialized FileDescriptorSet of a message and all it depends on, dependencies first.

    Raises:
        McapFileError: no such message is known to this process.
    """
    try:
        file = descriptor_pool.Default().FindMessageTypeByName(schema_name).file
    except KeyError:
        raise McapFileError(f"no protobuf message is called {schema_name!r}") from None
    ordered: dict[str, FileDescriptor] = {}
    _visit(file, ordered)
    files = FileDescriptorSet()
    for descriptor in ordered.values():
        descriptor.CopyToProto(files.file.add())
    return files.SerializeToString()


def _visit(file: FileDescriptor, ordered: dict[str, FileDescriptor]) -> None:
    for dependency in file.dependencies:
        _visit(dependency, ordered)
    ordered.setdefault(file.name, file)

"""Writer of MCAP files; channels and protobuf schemas are registered on first use."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import BinaryIO

from absmsg.v1 import (  # noqa: F401
    deformation_state_pb2,
    deformed_mesh_pb2,
    encoded_image_pb2,
    frame_info_pb2,
    health_pb2,
    sensor_model_pb2,
    surface_truth_pb2,
)

# Importing a message module registers its schema in the default descriptor pool, which `write` uses.
from foxglove_schemas_protobuf import (  # noqa: F401
    CameraCalibration_pb2,
    CompressedImage_pb2,
    FrameTransforms_pb2,
    PointCloud_pb2,
    RawImage_pb2,
    SceneUpdate_pb2,
)
from google.protobuf import descriptor_pool
from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

#: Uncompressed size at which a chunk is closed, and so the amount a reader decompresses to reach one message. With four
#: times as much the recorder takes twice the time, since the allocator gets such buffers from the system for every
#: chunk.
CHUNK_SIZE = 1 << 20

#: Name of the metadata records with id, topic and schema of each channel, redundant to the channel records.
CHANNEL_METADATA = "abs.channel"

#: Size of a file at which its channels are described again, and then whenever it has doubled [bytes].
DESCRIBED_AGAIN = 200_000


class Compression(StrEnum):
    """Compression of chunks; `LZ4` takes half the time of `ZSTD` and saves half as much."""

    NONE = "none"
    LZ4 = "lz4"
    ZSTD = "zstd"


class McapFileError(Exception):
    """An invalid message, or a file that has failed after an earlier error."""


class McapFile:
    """Writes protobuf messages, unchanged, to an MCAP stream.

    The first `OSError` (such as a full disk) is final: it is re-raised, and every later call raises
    `McapFileError`. Writing on would leave a file that looks complete and is corrupt.

    Args:
        stream: binary stream opened for writing, at its beginning; closed by the caller.
        compression: of the chunks.
        chunk_size: uncompressed bytes per chunk.

    Attributes:
        failure: what the stream has failed with; "" if it has not.
    """

    def __init__(
        self, stream: BinaryIO, compression: Compression = Compression.ZSTD, chunk_size: int = CHUNK_SIZE
    ) -> None:
        self._stream = stream
        self._writer = Writer(stream, chunk_size=chunk_size, compression=CompressionType[compression.name])
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[str, int]] = {}
        self._next_description = DESCRIBED_AGAIN
        self.failure = ""
        self._writer.start(profile="", library="abs-service")

    def write(self, topic: str, schema_name: str, payload: bytes, log_time_ns: int, sequence: int) -> None:
        """Appends one message.

        Args:
            topic: MCAP topic, such as `/sensor/stream/image`; one schema per topic.
            schema_name: full name of the protobuf message, such as `absmsg.v1.FrameInfo`.
            payload: the serialized message, written unchanged.
            log_time_ns: wall-clock time that the message refers to [ns]; log and publish time in the file.
            sequence: the sender's counter; its lower 32 bits are stored.

        Raises:
            McapFileError: unknown schema name, a second schema on the topic, or a failed file.
            OSError: the stream cannot be written; the file has failed.
        """
        channel = self._channel(topic, schema_name)
        self._attempt(
            lambda: self._writer.add_message(channel, log_time_ns, payload, log_time_ns, sequence & 0xFFFFFFFF)
        )

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Adds an attachment; one that is added at the beginning survives a later crash. Raises as `write`."""
        self._attempt(lambda: self._writer.add_attachment(time_ns, time_ns, name, media_type, data))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Adds a metadata record. Raises as `write`."""
        self._attempt(lambda: self._writer.add_metadata(name, dict(values)))

    def flush(self) -> None:
        """Closes the open chunk and flushes it to the operating system. Raises as `write`.

        Otherwise chunks are closed by size only, and a low-rate topic would stay in memory for a minute. Messages
        written before a flush are readable after the process was killed; call it once a second.
        """
        if (size := self._stream.tell()) >= self._next_description:
            # Whoever overwrites the beginning, with all names, leaves messages that nobody knows.
            self._next_description = 2 * size
            for topic, (schema_name, channel) in self._channels.items():
                self._name(channel, topic, schema_name)
        self._attempt(self._writer.flush)

    def finish(self) -> None:
        """Writes index and footer, and flushes the stream. Raises as `write`."""
        self._attempt(self._writer.finish)
        self._attempt(self._stream.flush)

    def _attempt(self, action: Callable[[], None]) -> None:
        if self.failure:
            raise McapFileError(f"an earlier write failed ({self.failure}); start a new file")
        try:
            action()
        except OSError as error:
            self.failure = str(error)
            raise

    def _channel(self, topic: str, schema_name: str) -> int:
        known, channel = self._channels.get(topic, (schema_name, 0))
        if known != schema_name:
            raise McapFileError(f"topic {topic} carries {known}, not {schema_name}")
        if channel == 0:
            channel = self._writer.register_channel(topic, MessageEncoding.Protobuf, self._schema(schema_name))
            self._channels[topic] = (schema_name, channel)
            # In an unfinished file one chunk alone has the channel record. This record serves if that chunk is damaged.
            self._name(channel, topic, schema_name)
        return channel

    def _name(self, channel: int, topic: str, schema_name: str) -> None:
        self.describe(CHANNEL_METADATA, {"id": str(channel), "topic": topic, "schema": schema_name})

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.Protobuf, file_descriptor_set(name))
        return self._schemas[name]


def file_descriptor_set(schema_name: str) -> bytes:
    """Serialized FileDescriptorSet of a message and its dependencies, dependencies first.

    Raises:
        McapFileError: unknown message.
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

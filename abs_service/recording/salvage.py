"""Copies the intact records of a damaged MCAP file to a new one."""

from typing import BinaryIO

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from abs_service.recording.mcap_scan import Data, RecordScanner
from drivers.encoding.mcap_file import CHANNEL_METADATA, McapFileError, file_descriptor_set


class Salvage:
    """Copies messages, attachments and metadata unchanged, and counts omissions.

    Attributes:
        messages: messages copied.
        chunks: chunks copied.
        damaged: chunks and other records left out because they are malformed or fail their checksum.
        orphans: messages left out because their channel is unknown.
        skipped_bytes: bytes that are no record.
    """

    def __init__(self, data: Data, output: BinaryIO) -> None:
        self.messages = self.chunks = self.orphans = 0
        self._data = data
        self._scan = RecordScanner(data)
        self._writer = Writer(output, compression=CompressionType.LZ4)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._written_schemas: dict[tuple[str, bytes], int] = {}
        self._written_channels: dict[tuple[str, str, int], int] = {}

    @property
    def damaged(self) -> int:
        """See the class."""
        return self._scan.damaged

    @property
    def skipped_bytes(self) -> int:
        """See the class."""
        return self._scan.skipped_bytes

    def run(self) -> None:
        """Copies everything.

        Raises:
            OSError: the output cannot be written.
        """
        self._writer.start(profile="", library="abs-service recover")
        # Channels are defined in chunks, which may be damaged, and also in metadata and in the index at the end.
        for record in RecordScanner(self._data):
            self._learn(record)
        for record in self._scan:
            if isinstance(record, Chunk):
                self._copy_chunk(record)
            else:
                self._copy(record)
        self._writer.finish()

    def _learn(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Metadata) and record.name == CHANNEL_METADATA:
            self._learn_from_metadata(record.metadata)

    def _learn_from_metadata(self, values: dict[str, str]) -> None:
        try:
            number, topic, name = int(values["id"]), values["topic"], values["schema"]
            schema = Schema(-number, file_descriptor_set(name), SchemaEncoding.Protobuf, name)
        except (KeyError, ValueError, McapFileError):
            return  # damaged, or from a version of the service that knew other messages
        self._schemas[schema.id] = schema
        self._channels.setdefault(number, Channel(number, topic, MessageEncoding.Protobuf, {}, schema.id))

    def _copy_chunk(self, chunk: Chunk) -> None:
        records = self._scan.open_chunk(chunk)
        self.chunks += bool(records)
        for record in records:
            self._learn(record)
            self._copy(record)

    def _copy(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            self._copy_message(record)
        elif isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata) and record.name != CHANNEL_METADATA:
            self._writer.add_metadata(record.name, record.metadata)

    def _copy_message(self, message: Message) -> None:
        channel = self._channels.get(message.channel_id)
        schema = self._schemas.get(channel.schema_id) if channel else None
        if channel is None or schema is None:
            self.orphans += 1
            return
        number = self._channel(channel, schema)
        self._writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
        self.messages += 1

    def _channel(self, channel: Channel, schema: Schema) -> int:
        kind = (schema.name, schema.data)
        if kind not in self._written_schemas:
            self._written_schemas[kind] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
        key = (channel.topic, channel.message_encoding, self._written_schemas[kind])
        if key not in self._written_channels:
            self._written_channels[key] = number = self._writer.register_channel(*key, channel.metadata)
            self._writer.add_metadata(
                CHANNEL_METADATA, {"id": str(number), "topic": channel.topic, "schema": schema.name}
            )
        return self._written_channels[key]

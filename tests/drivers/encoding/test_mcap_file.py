"""MCAP files are readable without our schemas; after a full disk every write fails."""

import io
from pathlib import Path

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from drivers.encoding.mcap_file import Compression, McapFile, McapFileError, file_descriptor_set

HEALTH = Health(header=Header(rig="demo"), component="capture", message="all is well").SerializeToString()


@pytest.mark.parametrize("compression", Compression)
def test_other_programs_read_the_file_without_our_schemas(tmp_path: Path, compression: Compression) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        file = McapFile(stream, compression)
        file.attach("rig.toml", "text/toml", b"version = 1\n", 9)
        file.write("/health/capture", "absmsg.v1.Health", HEALTH, 10, 1)
        file.write("/health/capture", "absmsg.v1.Health", HEALTH, 20, 2**32 + 2)
        file.finish()
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages())
        attachment = next(reader.iter_attachments())
    assert [(m.channel.topic, m.message.log_time, m.message.publish_time, m.message.sequence) for m in messages] == [
        ("/health/capture", 10, 10, 1),
        ("/health/capture", 20, 20, 2),
    ]
    assert messages[0].message.data == HEALTH
    assert messages[0].decoded_message.message == "all is well"
    assert (attachment.name, attachment.media_type, attachment.data) == ("rig.toml", "text/toml", b"version = 1\n")


def test_flushed_messages_are_readable_without_finish() -> None:
    stream = io.BytesIO()
    file = McapFile(stream)
    file.write("/health/capture", "absmsg.v1.Health", HEALTH, 10, 1)
    size = stream.tell()
    file.flush()
    assert stream.tell() > size
    records = iter(StreamReader(io.BytesIO(stream.getvalue())).records)
    assert any(isinstance(record, Message) and record.data == HEALTH for record in records)


def test_descriptors_come_with_their_dependencies_first() -> None:
    names = [file.name for file in FileDescriptorSet.FromString(file_descriptor_set("absmsg.v1.FrameInfo")).file]
    assert names == ["google/protobuf/timestamp.proto", "absmsg/v1/common.proto", "absmsg/v1/frame_info.proto"]


def test_an_unknown_schema_and_a_second_schema_on_a_topic_raise() -> None:
    file = McapFile(io.BytesIO())
    with pytest.raises(McapFileError, match=r"'absmsg\.v1\.Nonsense'"):
        file.write("/a", "absmsg.v1.Nonsense", b"", 0, 0)
    file.write("/a", "absmsg.v1.Health", b"", 0, 0)
    with pytest.raises(McapFileError, match=r"/a carries absmsg\.v1\.Health, not foxglove\.RawImage"):
        file.write("/a", "foxglove.RawImage", b"", 0, 0)


class FullDisk(io.BytesIO):
    """A stream of limited capacity."""

    def __init__(self, capacity: int) -> None:
        super().__init__()
        self.capacity = capacity

    def write(self, data, /) -> int:
        if self.tell() + len(data) > self.capacity:
            raise OSError(28, "No space left on device")
        return super().write(data)


def test_a_full_disk_fails_all_later_writes() -> None:
    disk = FullDisk(1 << 30)
    file = McapFile(disk)
    for i in range(5):
        file.write("/health/capture", "absmsg.v1.Health", HEALTH, i, i)
    disk.capacity = 0
    with pytest.raises(OSError, match="No space left"):
        file.flush()
    disk.capacity = 1 << 30
    for action in (file.flush, file.finish, lambda: file.attach("a", "text/plain", b"", 0)):
        with pytest.raises(McapFileError, match="No space left"):
            action()

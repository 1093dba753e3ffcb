"""Copies recordings with their images as they were published, which viewers show."""

from pathlib import Path
from typing import BinaryIO

from mcap.reader import McapReader, make_reader

from drivers.encoding import codec, encoded_image
from drivers.encoding.mcap_file import McapFile, McapFileError
from drivers.replay.contents import DAMAGE


class ExportError(Exception):
    """A recording that cannot be copied; names the file and the problem."""


def export(source: Path, target: BinaryIO) -> int:
    """Copies a recording; images become `foxglove.RawImage`, all else stays as it is. Returns the number of messages.

    Args:
        source: a finished recording.
        target: where the copy is written.

    Raises:
        ExportError: the recording is damaged, unfinished, or holds what is no message of ours.
        OSError: it cannot be read, or the copy cannot be written.
    """
    with source.open("rb") as stream:
        try:
            return _copy(make_reader(stream, validate_crcs=True), McapFile(target))
        except (*DAMAGE, codec.CodecError, McapFileError) as error:
            raise ExportError(f"{source}: {error}; `abs-service recover` saves what it can") from error


def _copy(reader: McapReader, file: McapFile) -> int:
    if reader.get_summary() is None:
        raise McapFileError("the recording was not finished")
    for attachment in reader.iter_attachments():
        file.attach(attachment.name, attachment.media_type, attachment.data, attachment.log_time)
    count = 0
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        name, payload = schema.name if schema else "", message.data
        if name in encoded_image.SCHEMAS:
            name, payload = codec.IMAGE_SCHEMA, encoded_image.decode(name, payload)
        file.write(channel.topic, name, payload, message.log_time, message.sequence)
        count += 1
    file.finish()
    return count

"""Copies of recordings that viewers show: images as they were published, depth in metres, meshes and points."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

from mcap.reader import make_reader
from mcap.records import Message

from abs_service.export.errors import ExportError
from abs_service.export.viewer_copy import ViewerCopy
from calib.camera import Camera
from drivers.encoding import codec
from drivers.encoding.mcap_file import McapFile, McapFileError
from drivers.replay import Recording
from drivers.replay.contents import DAMAGE, Contents, RecordingError, read_chunk


def export(
    source: Path, contents: Contents, target: BinaryIO, view_hz: float, advance: Callable[[], None]
) -> tuple[int, tuple[str, ...]]:
    """Copies a recording; returns the number of messages and what stays as it was. See `ViewerCopy`.

    Args:
        source: a finished recording.
        contents: of it.
        target: where the copy is written.
        view_hz: largest rate of the meshes and points that are added [Hz]; 0 for none.
        advance: called for each message that was read.

    Raises:
        ExportError: the recording is damaged, unfinished, or holds what is no message of ours.
        OSError: it cannot be read, or the copy cannot be written.
    """
    if contents.truncated:
        raise ExportError(f"{source}: the recording was not finished; `abs-service recover` saves what it can")
    with source.open("rb") as stream:
        try:
            copy = ViewerCopy(McapFile(target), _cameras(source), contents, view_hz)
            _copy(stream, contents, copy, advance)
        except (*DAMAGE, codec.CodecError, McapFileError) as error:
            raise ExportError(f"{source}: {error}; `abs-service recover` saves what it can") from error
    return copy.written, copy.notes


def _cameras(source: Path) -> Mapping[str, Camera]:
    """Cameras by sensor; none in a file without images, as `abs-service replay` writes."""
    try:
        return Recording(source).cameras
    except RecordingError:
        return {}


def _copy(stream: BinaryIO, contents: Contents, copy: ViewerCopy, advance: Callable[[], None]) -> None:
    for attachment in make_reader(stream).iter_attachments():
        copy.file.attach(attachment.name, attachment.media_type, attachment.data, attachment.log_time)
    for place in contents.chunks:
        for record in read_chunk(stream, place):
            if isinstance(record, Message):
                topic = contents.topics[record.channel_id]
                copy.add(topic.name, topic.schema, record)
                advance()
    copy.finish()

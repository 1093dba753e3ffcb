"""Copies the images of a recording into the file of its replay, for what shows meshes over images."""

from collections.abc import Iterator, Mapping

from abs_service.bus.stamps import HeaderFactory
from abs_service.capture.mcap_writing import write_cameras
from calib.camera import Camera
from drivers.encoding import codec, encoded_image
from drivers.encoding.mcap_file import McapFile
from drivers.replay import Recording
from drivers.replay.messages import messages


def image_copies(
    recording: Recording, cameras: Mapping[str, Camera], headers: HeaderFactory, file: McapFile
) -> Iterator[None]:
    """Writes the cameras, then with every step the messages of one image; beside what is written in between.

    Args:
        recording: whose images are copied, as they are.
        cameras: that the replay uses, by sensor name.
        headers: makes the headers of the cameras' messages.
        file: takes the messages.

    Raises:
        RecordingError: a corrupt chunk.
        McapFileError, OSError: as `McapFile.write`.
    """
    contents = recording.contents
    write_cameras(file, headers.at(0, 0), cameras, contents.start_ns)
    for topic, message in messages(recording.path, contents, {*encoded_image.SCHEMAS, codec.INFO_SCHEMA}):
        file.write(topic.name, topic.schema, message.data, message.log_time, message.sequence)
        if topic.schema == codec.INFO_SCHEMA:
            yield

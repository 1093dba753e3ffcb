"""Cameras and frames into a recording without a bus, as the recorder writes what it receives."""

from collections.abc import Mapping

from absmsg.v1.common_pb2 import Header

from abs_service.bus import keys
from abs_service.capture.sensor_metadata import of_cameras
from calib.camera import Camera
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.encoding.encoded_image import ImageEncoder, unchanged
from drivers.encoding.mcap_file import McapFile


def write_cameras(file: McapFile, header: Header, cameras: Mapping[str, Camera], wall_ns: int) -> None:
    """Writes models without noise, calibrations and poses of the sensors' cameras to a recording.

    Raises:
        McapFileError, OSError: as `McapFile.write`.
    """
    for topic, message in of_cameras(header, cameras, {name: {} for name in cameras}, wall_ns).items():
        file.write(f"/{topic}", message.DESCRIPTOR.full_name, message.SerializeToString(), wall_ns, 0)


def write_frame(
    file: McapFile, frame: Frame, header: Header, wall_ns: int, encode_image: ImageEncoder = unchanged
) -> None:
    """Writes image and metadata of a frame to a recording.

    Args:
        file: the recording.
        frame: what is written.
        header: of the metadata.
        wall_ns: wall-clock time of the exposure [ns].
        encode_image: of the image.

    Raises:
        McapFileError, OSError: as `McapFile.write`.
    """
    topic = keys.image(frame.sensor, frame.stream)
    file.write(f"/{topic}", *encode_image(codec.encode_image(frame, wall_ns)), wall_ns, frame.seq)
    file.write(f"/{keys.info(topic)}", codec.INFO_SCHEMA, codec.encode_info(frame, header), wall_ns, frame.seq)

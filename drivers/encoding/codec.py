"""Serialisation of frames and ground truth: `foxglove.RawImage`, `absmsg.v1.FrameInfo` and `absmsg.v1.SurfaceTruth`.

An image is two messages: RawImage, which every viewer displays, and FrameInfo, with our own metadata. The input is
untrusted: decoding yields a valid frame or a `CodecError` that names the problem.
"""

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError

from drivers.contract.device import Truth
from drivers.contract.frame import Frame, FrameError, Geometry, Kind, Reference
from drivers.encoding import raw_image
from drivers.encoding.message_check import check, parse_valid
from drivers.encoding.message_content import MessageError
from drivers.encoding.parsing import CodecError, bytes_per_pixel, pixels_of

IMAGE_SCHEMA = RawImage.DESCRIPTOR.full_name
INFO_SCHEMA = FrameInfo.DESCRIPTOR.full_name
TRUTH_SCHEMA = SurfaceTruth.DESCRIPTOR.full_name


def encode_image(frame: Frame, wall_ns: int) -> bytes:
    """The pixels of a frame as foxglove.RawImage.

    Args:
        frame: the frame.
        wall_ns: wall-clock time of the exposure [ns since the Unix epoch]; viewers show it.
    """
    height, width = frame.data.shape[:2]
    image = RawImage(
        frame_id=frame.sensor,
        width=width,
        height=height,
        encoding=frame.encoding,
        step=width * bytes_per_pixel(frame.encoding),
    )
    image.timestamp.FromNanoseconds(wall_ns)
    return raw_image.serialize(image, frame.data)


def encode_info(frame: Frame, header: Header) -> bytes:
    """Metadata of a frame as absmsg.v1.FrameInfo.

    Args:
        frame: the frame.
        header: sender and wall-clock time; its `t_host_ns` and `frame_id` are taken from the frame.
    """
    info = FrameInfo(
        header=header,
        sensor=frame.sensor,
        stream=frame.stream,
        kind=frame.kind.value,
        seq=frame.seq,
        epoch=frame.epoch,
        scale=frame.scale,
        unit=frame.unit,
        geometry=f"GEOMETRY_{frame.geometry.name}",
        invalid=frame.invalid,
        t_device_ticks=frame.t_device_ticks,
        tick_hz=frame.tick_hz,
        clock_domain=frame.clock_domain,
        t_sigma_ns=frame.t_sigma_ns,
        t_reference=f"REFERENCE_{frame.t_reference.name}",
        t_arrival_ns=frame.t_arrival_ns,
        exposure_s=frame.exposure_s,
        gain=frame.gain,
        temperature_c=frame.temperature_c,
        modulation=frame.modulation,
        calib_id=frame.calib_id,
        undistorted=frame.undistorted,
        aligned_to=frame.aligned_to,
        filters=frame.filters,
        incomplete=frame.incomplete,
        saturated=frame.saturated,
    )
    info.header.t_host_ns = frame.t_host_ns
    info.header.frame_id = frame.sensor
    return info.SerializeToString()


def check_frame(frame: Frame) -> None:
    """Checks that a message can hold a frame, and that its receivers would take it.

    Raises:
        Exception: neither of them; protobuf raises others than `CodecError` for values of a wrong type.
    """
    parse_valid(FrameInfo, encode_info(frame, Header()))
    if not frame.data.size:
        raise CodecError(f"{frame.sensor}/{frame.stream}: an image of shape {frame.data.shape} has no pixels")


def parse_image(payload: bytes) -> tuple[RawImage, memoryview]:
    """A serialized foxglove.RawImage without its pixels, and a view of these.

    Raises:
        CodecError: malformed message, or one that is not allowed.
    """
    try:
        image, pixels = raw_image.parse(payload)
    except DecodeError as error:
        raise MessageError("malformed", f"{len(payload)} bytes are no {IMAGE_SCHEMA}: {error}") from error
    check(image)
    return image, pixels


def decode(image: bytes, info: bytes) -> Frame:
    """The frame of a serialized foxglove.RawImage and its absmsg.v1.FrameInfo; its pixels are a view of those bytes.

    Raises:
        CodecError: malformed or inconsistent messages.
    """
    (picture, pixels), about = parse_image(image), parse_valid(FrameInfo, info)
    name = f"{about.sensor}/{about.stream}"
    if picture.frame_id != about.sensor:
        raise CodecError(f"{name}: the image is of sensor {picture.frame_id!r}, its info of {about.sensor!r}")
    try:
        return Frame(
            sensor=about.sensor,
            stream=about.stream,
            kind=_kind(name, about.kind),
            data=pixels_of(name, picture, pixels),
            encoding=picture.encoding,
            t_host_ns=about.header.t_host_ns,
            t_arrival_ns=about.t_arrival_ns,
            seq=about.seq,
            epoch=about.epoch,
            scale=about.scale,
            unit=about.unit,
            geometry=Geometry[FrameInfo.Geometry.Name(about.geometry).removeprefix("GEOMETRY_")],
            invalid=about.invalid if about.HasField("invalid") else None,
            t_device_ticks=about.t_device_ticks,
            tick_hz=about.tick_hz,
            clock_domain=about.clock_domain,
            t_sigma_ns=about.t_sigma_ns,
            t_reference=Reference[FrameInfo.Reference.Name(about.t_reference).removeprefix("REFERENCE_")],
            exposure_s=about.exposure_s,
            gain=about.gain,
            temperature_c=about.temperature_c,
            modulation=about.modulation,
            calib_id=about.calib_id,
            undistorted=about.undistorted,
            aligned_to=about.aligned_to,
            filters=tuple(about.filters),
            incomplete=about.incomplete,
            saturated=about.saturated,
            host_clock=about.header.host_clock,
        )
    except FrameError as error:
        raise CodecError(str(error)) from error


def encode_truth(truth: Truth, header: Header) -> bytes:
    """Ground truth as absmsg.v1.SurfaceTruth; `header.t_host_ns` is taken from the truth."""
    rows, columns = truth.points_r.shape[:2]
    message = SurfaceTruth(
        header=header,
        seq=truth.seq,
        rows=rows,
        columns=columns,
        points_f32=truth.points_r.astype("<f4").tobytes(),
        surface=truth.surface,
    )
    message.header.t_host_ns = truth.t_host_ns
    return message.SerializeToString()


def decode_truth(payload: bytes) -> Truth:
    """Ground truth from a serialized absmsg.v1.SurfaceTruth.

    Raises:
        CodecError: malformed message, or a number of points that differs from the declared one.
    """
    message = parse_valid(SurfaceTruth, payload)
    points_r = np.frombuffer(message.points_f32, "<f4").reshape(message.rows, message.columns, 3)
    return Truth(message.seq, message.header.t_host_ns, points_r, message.surface)


def _kind(name: str, value: str) -> Kind:
    try:
        return Kind(value)
    except ValueError:
        raise CodecError(f"{name}: kind {value!r} is none of {[kind.value for kind in Kind]}") from None

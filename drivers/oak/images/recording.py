"""Recordings of depthai: one MCAP file per stream, decoded without depthai by the schema in each file.

A recording is a file or a folder of files; the name of each, without `.mcap`, is one of `drivers.oak.roles.ROLES`.
The extrinsics are in `calibration.json` beside them, if it exists, else in the images' metadata.
"""

import heapq
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import islice, repeat
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from mcap.reader import make_reader

from calib.camera import Camera
from calib.files import limited
from drivers.contract.frame import Frame
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.oak import eeprom
from drivers.oak.eeprom import EepromError, Extrinsics, Poses, extrinsics_of
from drivers.oak.images.heads import cameras
from drivers.oak.images.picture import Picture, PictureError, frame, number
from drivers.oak.roles import ROLES, Role

SCHEMA = "dai.proto.img_frame.ImgFrame"
CALIBRATION = "calibration.json"


class OakRecording:
    """A recording of depthai.

    Raises:
        ForeignRecordingError: a file cannot be read, its name is no stream's, or a camera is not understood.
    """

    def __init__(self, path: Path) -> None:
        self._files = {role: file for file, role in files(path).items()}
        self.total = sum(map(_count, self._files.values()))
        try:
            first = {role: picture(_first(file)) for role, file in self._files.items()}
            self.cameras: Mapping[str, Camera] = cameras(first, poses(path))
        except (EepromError, PictureError) as error:
            raise ForeignRecordingError(f"{path}: {error}") from error

    def frames(self) -> Iterator[Frame]:
        """All images in order of host time, which counts from the boot of the recording host."""
        streams = [zip(repeat(role), _messages(file)) for role, file in self._files.items()]
        for role, message in heapq.merge(*streams, key=lambda entry: _ns(entry[1].ts)):
            try:
                yield frame(picture(message), role, self.cameras[role.sensor].calib_id, ())
            except PictureError as error:
                raise ForeignRecordingError(f"{self._files[role]}: image {message.sequenceNum}: {error}") from error


def files(path: Path) -> dict[Path, Role]:
    """Files of a recording and their streams.

    Raises:
        ForeignRecordingError: no file, or a name that is no stream's.
    """
    found = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    strange = [file for file in found if file.stem not in ROLES]
    if strange or not found:
        what = f"{strange[0]}: its name says what it holds" if strange else f"{path}: there is no MCAP file in it"
        raise ForeignRecordingError(f"{what}; it must be one of {', '.join(f'{name}.mcap' for name in ROLES)}")
    return {file: ROLES[file.stem] for file in found}


def poses(path: Path) -> Poses:
    """Extrinsics of the cameras, from the calibration file or from the images' metadata.

    Raises:
        ForeignRecordingError: a file cannot be read.
        EepromError: malformed calibration.
    """
    file = (path if path.is_dir() else path.parent) / CALIBRATION
    try:
        if file.is_file():
            return eeprom.parse(limited.read(file, limited.MAX_TEXT_BYTES))
    except OSError as error:
        raise ForeignRecordingError(f"{file}: cannot be read: {error.strerror}") from error
    messages = map(_first, files(path))
    return Poses({message.instanceNum: _extrinsics(message.transformation.extrinsics) for message in messages})


def rate_hz(path: Path) -> float:
    """Frame rate of a recording, from the first two images of its first file; 30 with fewer images.

    Raises:
        ForeignRecordingError: a file cannot be read.
    """
    first, *more = (_ns(message.tsDevice) for message in islice(_messages(next(iter(files(path)))), 2))
    return 1e9 / (more[0] - first) if more and more[0] > first else 30.0


def picture(message: Any) -> Picture:
    """Picture of a decoded message; never raises, errors surface when it is converted."""
    specs, settings, transformation = message.fb, message.cam, message.transformation
    source, own = _matrix(transformation.sourceIntrinsicMatrix), _matrix(transformation.transformationMatrix)
    return Picture(
        type=_name(specs, "type"),
        width=specs.width,
        height=specs.height,
        stride=specs.stride,
        data=np.frombuffer(message.data, np.uint8),
        seq=message.sequenceNum,
        host_ns=_ns(message.ts),
        device_ns=_ns(message.tsDevice),
        exposure_s=number(settings.exposureTimeUs * 1e-6),
        gain=number(settings.sensitivityIso / 100),
        temperature_c=number(settings.sensorTemperatureC, 200.0),
        socket=message.instanceNum,
        matrix=own @ source if source.shape == own.shape == (3, 3) else np.zeros((0, 0)),
        model=_name(transformation, "distortionModel"),
        coefficients=tuple(transformation.distortionCoefficients.values),
        extrinsics=_extrinsics(transformation.extrinsics),
    )


def _extrinsics(extrinsics: Any) -> Extrinsics:
    t, rotation = extrinsics.translation, _matrix(extrinsics.rotationMatrix)
    return extrinsics_of(rotation, (t.x, t.y, t.z), extrinsics.toCameraSocket, extrinsics.lengthUnit)


def _matrix(matrix: Any) -> np.ndarray:
    rows = [list(row.values) for row in matrix.arrays]
    return np.array(rows) if rows and len({len(row) for row in rows}) == 1 else np.zeros((0, 0))


def _name(message: Any, field: str) -> str:
    """Name of an enumeration value, its number if unnamed."""
    values = message.DESCRIPTOR.fields_by_name[field].enum_type.values_by_number
    value = getattr(message, field)
    return values[value].name if value in values else str(value)


def _ns(stamp: Any) -> int:
    return stamp.sec * 1_000_000_000 + stamp.nsec


def _first(path: Path) -> Any:
    message = next(_messages(path), None)
    if message is None:
        raise ForeignRecordingError(f"{path}: there are no messages {SCHEMA} in it")
    return message


def _count(path: Path) -> int:
    with _translated_errors(path), path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        return sum(summary.statistics.channel_message_counts.values()) if summary and summary.statistics else 0


def _messages(path: Path) -> Iterator[Any]:
    """Images of a file in order of time."""
    with _translated_errors(path), path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        types: dict[int, Any] = {}
        for schema, _, message in reader.iter_messages():
            if schema is None or schema.name != SCHEMA:
                continue
            if schema.id not in types:
                types[schema.id] = _type(schema.data)
            yield types[schema.id].FromString(message.data)


def _type(descriptors: bytes) -> Any:
    """Message class of a file's schema; in a separate pool, since versions differ."""
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(descriptors).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(SCHEMA))


@contextmanager
def _translated_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ForeignRecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # MCAP and protobuf readers raise arbitrary exceptions for corrupt bytes
        what = f"{type(error).__name__}: {error}"  # the repr of a UnicodeDecodeError holds all that it could not decode
        raise ForeignRecordingError(f"{path}: this is no recording of depthai, or a damaged one: {what}") from error

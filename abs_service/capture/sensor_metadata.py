"""Messages with the metadata of a rig: calibrations, noise models, poses, configuration, schema."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from absmsg.v1 import common_pb2, sensor_model_pb2
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

import abs_service
from abs_service.bus import keys
from abs_service.wire.message_header import MESSAGES
from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from drivers.encoding.mcap_file import file_descriptor_set

#: Names of the lens models in `foxglove.CameraCalibration`.
_DISTORTION_MODELS = {Lens.name: "rational_polynomial", KannalaBrandt.name: "kannala_brandt"}


def of_cameras(
    header: common_pb2.Header, cameras: Mapping[str, Camera], noises: Mapping[str, Mapping[str, Any]], wall_ns: int
) -> dict[str, Message]:
    """Models, calibrations and poses of sensors by topic, from their cameras and noise models by sensor name."""
    messages: dict[str, Message] = {}
    for sensor, camera in cameras.items():
        messages[keys.model(sensor)] = sensor_model(header, sensor, camera, noises[sensor])
        messages[keys.calibration(sensor)] = calibration(sensor, camera, wall_ns)
    return messages | ({keys.TRANSFORMS: transforms(cameras, wall_ns)} if cameras else {})


def calibration(sensor: str, camera: Camera, wall_ns: int) -> CameraCalibration:
    """A camera as a message for viewers; its pose is in `transforms`."""
    K = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    message = CameraCalibration(
        frame_id=sensor,
        width=camera.width,
        height=camera.height,
        distortion_model=_DISTORTION_MODELS[camera.lens.name],
        D=camera.lens.coefficients.tolist(),
        K=K,
        R=np.eye(3).ravel().tolist(),
        P=[camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
    message.timestamp.FromNanoseconds(wall_ns)
    return message


def transforms(cameras: Mapping[str, Camera], wall_ns: int) -> FrameTransforms:
    """Poses of the sensors in the rig as a message, from their cameras by sensor name."""
    message = FrameTransforms()
    for sensor, camera in cameras.items():
        transform = message.transforms.add(parent_frame_id=keys.RIG_FRAME, child_frame_id=sensor)
        transform.timestamp.FromNanoseconds(wall_ns)
        x, y, z = camera.center.tolist()
        transform.translation.x, transform.translation.y, transform.translation.z = x, y, z
        qx, qy, qz, qw = pose.to_quaternion(camera.T_rs).tolist()
        rotation = transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = qx, qy, qz, qw
    return message


def sensor_model(
    header: common_pb2.Header, sensor: str, camera: Camera, noise: Mapping[str, Any]
) -> sensor_model_pb2.SensorModel:
    """Camera and noise model of a sensor as a message.

    Args:
        header: of the message.
        sensor: its name.
        camera: its projection.
        noise: `type` and parameters of the noise model and the outliers' share and range, as in TOML; empty if the
            sensor has none. Only numbers and arrays of numbers are included, row by row.
    """
    message = sensor_model_pb2.SensorModel(
        header=header,
        sensor=sensor,
        width=camera.width,
        height=camera.height,
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        lens=camera.lens.coefficients.tolist(),
        lens_model=camera.lens.name,
        T_rs=camera.T_rs.ravel().tolist(),
        calib_id=camera.calib_id,
        noise=noise.get("type", ""),
    )
    for name, value in noise.items():
        if not isinstance(value, str):
            message.noise_parameters[name].values.extend(_numbers(value))
    return message


def _numbers(value: Any) -> list[float]:
    if isinstance(value, (list, tuple)):
        return [number for part in value for number in _numbers(part)]
    return [float(value)] if isinstance(value, (int, float)) else []


def config(header: common_pb2.Header, toml: str) -> sensor_model_pb2.Config:
    """The effective configuration as a message."""
    digest = hashlib.sha256(toml.encode()).hexdigest()
    return sensor_model_pb2.Config(header=header, toml=toml, sha256=digest, version=abs_service.__version__)


def schema() -> bytes:
    """Serialized FileDescriptorSet of all messages on the wire, dependencies first."""
    files = {}
    for message in sorted(MESSAGES):
        for file in FileDescriptorSet.FromString(file_descriptor_set(message)).file:
            files.setdefault(file.name, file)
    return FileDescriptorSet(file=files.values()).SerializeToString()


SCHEMA_MESSAGE = FileDescriptorSet.DESCRIPTOR.full_name

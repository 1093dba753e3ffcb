"""depthai pipelines, configured for raw images with as few filters as possible."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from drivers.contract.device import DeviceError
from drivers.oak.address import Address
from drivers.oak.roles import ROLES, Role


@dataclass(frozen=True, eq=False)
class Outputs:
    """Outputs and control inputs of a pipeline.

    Attributes:
        streams: outputs of nodes.
        filters: filters applied by the device, by stream.
        cameras: inputs for `dai.CameraControl`, by the prefix of their controls: "" for depth, "color." for colour.
        tof: input for `dai.ToFConfig`, None without a time-of-flight camera.
    """

    streams: Mapping[Role, Any]
    filters: Mapping[Role, tuple[str, ...]] = field(default_factory=dict)
    cameras: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    tof: Any = None


def build(dai: Any, device: Any, pipeline: Any, address: Address) -> Outputs:
    """Builds the pipeline for an address.

    Raises:
        DeviceError: the device lacks a requested camera; names those that it has.
    """
    features = device.getConnectedCameraFeatures()
    kinds = dai.CameraSensorType
    tof = [camera.socket for camera in features if kinds.TOF in camera.supportedTypes]
    pairs = device.getStereoPairs()
    if (address.mode == "tof" and not tof) or (address.mode == "stereo" and not pairs) or not (tof or pairs):
        has = ", ".join(f"{camera.socket.name}: {camera.sensorName}" for camera in features) or "no camera at all"
        raise DeviceError(f"{address.uri}: mode = {address.mode} needs a camera that the device lacks; it has {has}")
    if tof and address.mode != "stereo":
        depth = time_of_flight(dai, device, pipeline, tof[0], address)
    else:
        depth = stereo(dai, pipeline, pairs[0], address)
    used = {tof[0]} if tof and address.mode != "stereo" else {pairs[0].left, pairs[0].right}
    sockets = [
        camera.socket for camera in features if kinds.COLOR in camera.supportedTypes and camera.socket not in used
    ]
    if not address.color or not sockets:
        return depth
    node = pipeline.create(dai.node.Camera).build(sockets[0])
    output = node.requestOutput(
        address.size, type=dai.ImgFrame.Type.NV12, fps=address.fps, enableUndistortion=address.undistort
    )
    streams = {**depth.streams, ROLES["color"]: output}
    return Outputs(streams, depth.filters, {**depth.cameras, "color.": (node.inputControl,)}, depth.tof)


def time_of_flight(dai: Any, device: Any, pipeline: Any, socket: Any, address: Address) -> Outputs:
    """Time-of-flight camera: depth along z, unfiltered if available, amplitude, intensity and confidence."""
    profile = getattr(dai.ToFConfig.Profile, f"{address.range.upper()}_RANGE")
    node = pipeline.create(dai.node.ToF).build(socket, profile=profile, fps=address.fps)
    config = node.getInitialConfig()
    config.enableOpticalCorrection = True  # z; without it the distances would be radial
    node.setInitialConfig(config)
    streams = {ROLES["tof_amplitude"]: node.amplitude, ROLES["tof_intensity"]: node.intensity}
    depth = ROLES["tof_depth"]
    if device.getPlatform() == dai.Platform.RVC2:
        # `depth` is filtered on the host across pixels, which violates the per-pixel noise models.
        return Outputs({depth: node.rawDepth, **streams}, {}, {}, node.inputConfig)
    filtered = {depth: ("depthai image filters",)}
    return Outputs(
        {depth: node.depth, **streams, ROLES["tof_confidence"]: node.confidence}, filtered, {}, node.inputConfig
    )


def stereo(dai: Any, pipeline: Any, pair: Any, address: Address) -> Outputs:
    """Depth in the rectified view of the left camera, and both rectified images."""
    cameras = [pipeline.create(dai.node.Camera).build(socket) for socket in (pair.left, pair.right)]
    images = [node.requestOutput(address.size, type=dai.ImgFrame.Type.GRAY8, fps=address.fps) for node in cameras]
    node = pipeline.create(dai.node.StereoDepth).build(*images, presetMode=dai.node.StereoDepth.PresetMode.DEFAULT)
    node.setDepthAlign(dai.StereoDepthConfig.AlgorithmControl.DepthAlign.RECTIFIED_LEFT)
    node.setLeftRightCheck(True)
    node.setSubpixel(True)
    node.initialConfig.setMedianFilter(dai.MedianFilter.MEDIAN_OFF)
    streams = {
        ROLES["depth"]: node.depth,
        ROLES["left"]: node.rectifiedLeft,
        ROLES["right"]: node.rectifiedRight,
    }
    return Outputs(streams, {ROLES["depth"]: ("left-right check",)}, {"": tuple(n.inputControl for n in cameras)})

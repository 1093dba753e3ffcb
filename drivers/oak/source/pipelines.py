"""depthai pipelines, configured for raw images with as few filters as possible.

What presets switch on is in depthai-core: src/pipeline/node/StereoDepth.cpp and src/pipeline/datatype/ToFConfig.cpp.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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
        pair: sockets of the left and of the right stereo camera, None without stereo.
    """

    streams: Mapping[Role, Any]
    filters: Mapping[Role, tuple[str, ...]] = field(default_factory=dict)
    cameras: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    tof: Any = None
    pair: tuple[int, int] | None = None

    @property
    def views(self) -> Mapping[Role, int]:
        """Socket of the camera whose view a stream is, where the pipeline decides it."""
        if self.pair is None:
            return {}
        return {ROLES["depth"]: self.pair[0], ROLES["left"]: self.pair[0], ROLES["right"]: self.pair[1]}


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
    return replace(depth, streams=streams, cameras={**depth.cameras, "color.": (node.inputControl,)})


def time_of_flight(dai: Any, device: Any, pipeline: Any, socket: Any, address: Address) -> Outputs:
    """Time-of-flight camera: depth along z, unfiltered if available, amplitude, intensity and confidence.

    `enableOpticalCorrection` makes RVC2 convert the distances along the rays, which it measures, to distances along z:
    "it does rectification and distance to depth conversion (Z-map)", and without it the node returns distance
    (docs.luxonis.com/software-v3/depthai/depthai-components/nodes/tof). `rawDepth` is the output of that same decoder,
    before the host's filters. RVC4 converts unless told otherwise (`enableRadialToPerp`).
    """
    profile = getattr(dai.ToFConfig.Profile, f"{address.range.upper()}_RANGE")
    node = pipeline.create(dai.node.ToF).build(socket, profile=profile, fps=address.fps)
    config = node.getInitialConfig()
    config.enableOpticalCorrection = True
    node.setInitialConfig(config)
    streams = {ROLES["tof_amplitude"]: node.amplitude, ROLES["tof_intensity"]: node.intensity}
    depth = ROLES["tof_depth"]
    if device.getPlatform() == dai.Platform.RVC2:
        # `depth` is filtered on the host across pixels, which violates the per-pixel noise models.
        averaged = {depth: ("phase shuffle average",)} if config.enablePhaseShuffleTemporalFilter else {}
        return Outputs({depth: node.rawDepth, **streams}, averaged, {}, node.inputConfig)
    filtered = {depth: ("bilateral filter", "temporal noise reduction", "flying pixel correction")}
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
    switch_filters_off(dai, node.initialConfig)
    streams = {
        ROLES["depth"]: node.depth,
        ROLES["left"]: node.rectifiedLeft,
        ROLES["right"]: node.rectifiedRight,
    }
    filters = {ROLES["depth"]: ("left-right check", "confidence threshold")}
    inputs = {"": tuple(node.inputControl for node in cameras)}
    return Outputs(streams, filters, inputs, pair=(pair.left.value, pair.right.value))


def switch_filters_off(dai: Any, config: Any) -> None:
    """Switches off all filters of a `dai.StereoDepthConfig` that mix pixels or images, or make the image smaller.

    The default preset has nearly all of them on: decimation by 2, median, speckle, spatial and temporal filters, and
    filling of holes. What is left invalidates single pixels.
    """
    config.setMedianFilter(dai.MedianFilter.MEDIAN_OFF)
    filters = config.postProcessing
    filters.decimationFilter.decimationFactor = 1
    filters.bilateralSigmaValue = 0
    for one in (
        filters.spatialFilter,
        filters.temporalFilter,
        filters.speckleFilter,
        filters.holeFilling,
        filters.adaptiveMedianFilter,
    ):
        one.enable = False
    filters.thresholdFilter.minRange, filters.thresholdFilter.maxRange = 0, 65535

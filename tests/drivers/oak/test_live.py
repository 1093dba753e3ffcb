"""Attached devices, by mocks with the methods of the real ones: pipelines, controls, discovery."""

from typing import Any
from unittest.mock import MagicMock, create_autospec

import pytest

from drivers.contract.device import ControlError, DeviceError, SdkMissingError
from drivers.contract.discovery import Availability
from drivers.contract.frame import Kind
from drivers.oak import library
from drivers.oak.address import parse
from drivers.oak.range_profile import RangeProfile
from drivers.oak.roles import ROLES
from drivers.oak.source import live, pipelines
from drivers.oak.source.controls import make

try:
    dai = library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


def mock_device(platform: str, tof: bool) -> Any:
    """A mock with exactly the methods of the real device."""
    device = create_autospec(dai.Device, instance=True)
    kinds = dai.CameraSensorType
    cameras = [(dai.CameraBoardSocket.CAM_C, kinds.COLOR)]
    cameras += [(dai.CameraBoardSocket.CAM_A, kinds.TOF)] if tof else []
    features = []
    for socket, kind in cameras:
        camera = dai.CameraFeatures()
        camera.socket, camera.supportedTypes, camera.sensorName = socket, [kind], "sensor"
        features.append(camera)
    device.getConnectedCameraFeatures.return_value = features
    pair = dai.StereoPair()
    pair.left, pair.right = dai.CameraBoardSocket.CAM_B, dai.CameraBoardSocket.CAM_D
    device.getStereoPairs.return_value = [] if tof else [pair]
    device.getPlatform.return_value = getattr(dai.Platform, platform)
    device.getIrDrivers.return_value = [] if tof else [("driver", 0, 0)]
    device.setIrLaserDotProjectorIntensity.return_value = True
    return device


def profile() -> RangeProfile:
    return RangeProfile("mid", lambda: 0)


def mock_pipeline() -> tuple[Any, list[Any]]:
    """A mock whose nodes have the methods and outputs of the real ones."""
    nodes: list[Any] = []

    def create(kind: Any) -> Any:
        node = create_autospec(kind, instance=True)
        node.build.return_value = node
        nodes.append(node)
        return node

    pipeline = MagicMock()
    pipeline.create.side_effect = create
    return pipeline, nodes


@pytest.mark.parametrize(("platform", "output"), [("RVC2", "rawDepth"), ("RVC4", "depth")])
def test_time_of_flight_takes_depth_before_the_filters_where_it_exists(platform: str, output: str) -> None:
    pipeline, nodes = mock_pipeline()
    built = pipelines.build(dai, mock_device(platform, tof=True), pipeline, parse("oak://?range=low&fps=20"))
    tof, color = nodes
    assert built.streams[ROLES["tof_depth"]] is getattr(tof, output)
    assert built.streams[ROLES["tof_amplitude"]] is tof.amplitude
    assert (ROLES["tof_confidence"] in built.streams) == (platform == "RVC4")
    assert ("temporal noise reduction" in built.filters[ROLES["tof_depth"]]) == (platform == "RVC4")
    tof.build.assert_called_once_with(dai.CameraBoardSocket.CAM_A, profile=dai.ToFConfig.Profile.LOW_RANGE, fps=20.0)
    assert tof.setInitialConfig.call_args[0][0].enableOpticalCorrection is True
    assert built.streams[ROLES["color"]] is color.requestOutput.return_value


def test_stereo_gives_depth_in_the_view_of_the_left_image() -> None:
    pipeline, nodes = mock_pipeline()
    built = pipelines.build(dai, mock_device("RVC2", tof=False), pipeline, parse("oak://?color=0"))
    left, right, stereo = nodes
    left.build.assert_called_once_with(dai.CameraBoardSocket.CAM_B)
    right.build.assert_called_once_with(dai.CameraBoardSocket.CAM_D)
    assert {role.kind for role in built.streams} == {Kind.DEPTH, Kind.IR}
    assert built.streams[ROLES["left"]] is stereo.rectifiedLeft
    aligned = stereo.setDepthAlign.call_args[0][0]
    assert aligned == dai.StereoDepthConfig.AlgorithmControl.DepthAlign.RECTIFIED_LEFT
    assert built.views == {ROLES["depth"]: 1, ROLES["left"]: 1, ROLES["right"]: 3}


def test_no_filter_of_stereo_mixes_pixels() -> None:
    """The configuration that the default preset leaves, as depthai-core 3.4 has it in setRvc2ProfilePreset."""
    config = dai.StereoDepthConfig()
    filters = config.postProcessing
    mixing = [filters.spatialFilter, filters.temporalFilter, filters.speckleFilter]
    mixing += [filters.holeFilling, filters.adaptiveMedianFilter]
    for one in mixing:
        one.enable = True
    filters.decimationFilter.decimationFactor = 2
    filters.thresholdFilter.maxRange = 15000
    config.setMedianFilter(dai.MedianFilter.KERNEL_7x7)
    pipeline, nodes = mock_pipeline()
    create = pipeline.create.side_effect

    def with_config(kind: Any) -> Any:
        node = create(kind)
        if kind is dai.node.StereoDepth:
            node.initialConfig = config
        return node

    pipeline.create.side_effect = with_config
    built = pipelines.build(dai, mock_device("RVC2", tof=False), pipeline, parse("oak://?color=0"))
    assert nodes[2].initialConfig is config
    left = config.postProcessing
    for one in (
        left.spatialFilter,
        left.temporalFilter,
        left.speckleFilter,
        left.holeFilling,
        left.adaptiveMedianFilter,
    ):
        assert not one.enable
    assert left.decimationFilter.decimationFactor == 1
    assert left.thresholdFilter.maxRange == 65535
    assert config.getMedianFilter() == dai.MedianFilter.MEDIAN_OFF
    assert built.filters == {ROLES["depth"]: ("left-right check", "confidence threshold")}


@pytest.mark.parametrize(("mode", "tof"), [("tof", False), ("stereo", True)])
def test_an_unsupported_mode_raises_with_the_existing_cameras(mode: str, tof: bool) -> None:
    with pytest.raises(DeviceError, match=f"mode = {mode} needs a camera that the device lacks; it has CAM_C: sensor"):
        pipelines.build(dai, mock_device("RVC2", tof), mock_pipeline()[0], parse(f"oak://?mode={mode}"))


def test_controls_reach_every_camera_behind_depth() -> None:
    device, (pipeline, nodes) = mock_device("RVC2", tof=False), mock_pipeline()
    address = parse("oak://?dots=0.4")
    controls = make(dai, device, pipelines.build(dai, device, pipeline, address), address, profile())
    assert controls.get("laser_power") == 0.4
    device.setIrLaserDotProjectorIntensity.assert_called_once_with(0.4)
    controls.set("exposure_s", 0.004)
    assert controls.get("auto_exposure") is False
    for camera in nodes[:2]:
        (message,) = camera.inputControl.createInputQueue.return_value.send.call_args[0]
        assert message.getExposureTime().total_seconds() == 0.004
    with pytest.raises(ControlError, match=r"must be a number from 2e-05 to 0.033 s"):
        controls.set("exposure_s", 1.0)
    with pytest.raises(ControlError, match="no such control"):
        controls.set("color.focus", 1)


def test_the_range_can_be_changed_while_it_runs() -> None:
    device, (pipeline, nodes) = mock_device("RVC2", tof=True), mock_pipeline()
    address = parse("oak://")
    ranges = profile()
    controls = make(dai, device, pipelines.build(dai, device, pipeline, address), address, ranges)
    controls.set("modulation", "high")
    (config,) = nodes[0].inputConfig.createInputQueue.return_value.send.call_args[0]
    assert config.profile == dai.ToFConfig.Profile.HIGH_RANGE
    assert controls.get("modulation") == ranges.current == "high"


def test_a_rejected_sync_role_leaves_the_control_unchanged() -> None:
    device, (pipeline, _) = mock_device("RVC2", tof=True), mock_pipeline()
    address = parse("oak://")
    controls = make(dai, device, pipelines.build(dai, device, pipeline, address), address, profile())
    device.setExternalFrameSyncRole.return_value = (True, "")
    controls.set("sync_role", "slave")
    device.setExternalFrameSyncRole.assert_called_once_with(dai.ExternalFrameSyncRole.SLAVE)
    device.setExternalFrameSyncRole.return_value = (False, "no cable")
    with pytest.raises(DeviceError, match="sync_role = master: no cable"):
        controls.set("sync_role", "master")
    assert controls.get("sync_role") == "slave"


@pytest.mark.parametrize(
    ("status", "state", "availability"),
    [
        ("X_LINK_SUCCESS", "X_LINK_UNBOOTED", Availability.READY),
        ("X_LINK_SUCCESS", "X_LINK_BOOTED", Availability.BUSY),
        ("X_LINK_INSUFFICIENT_PERMISSIONS", "X_LINK_UNBOOTED", Availability.NO_PERMISSION),
    ],
)
def test_attached_devices_have_availability_and_remedy(
    monkeypatch: pytest.MonkeyPatch, status: str, state: str, availability: Availability
) -> None:
    info = dai.DeviceInfo("18443010E1A2B3C4")
    info.platform, info.protocol = dai.XLinkPlatform.X_LINK_RVC4, dai.XLinkProtocol.X_LINK_USB_VSC
    info.status, info.state = getattr(dai.XLinkError_t, status), getattr(dai.XLinkDeviceState, state)
    monkeypatch.setattr(dai.Device, "getAllConnectedDevices", lambda: [info])
    (found,) = live.discover(0.1)
    assert (found.availability, found.info.uri) == (availability, "oak://18443010E1A2B3C4")
    assert (found.info.model, found.info.link) == ("OAK (RVC4)", "USB, speed known once opened")
    assert bool(found.remedy) == (availability != Availability.READY)


def test_a_rejected_sync_role_in_the_address_raises_and_the_device_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    device = mock_device("RVC2", tof=True)
    device.setExternalFrameSyncRole.return_value = (False, "no M8 connector")
    monkeypatch.setattr(dai, "Device", lambda info: device)
    with pytest.raises(DeviceError, match="sync = master: no M8 connector"):
        live.connect(parse("oak://18443010E1A2B3C4?sync=master"))
    device.close.assert_called_once_with()

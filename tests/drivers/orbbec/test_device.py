"""The Orbbec driver on Orbbec's SDK itself: its player, its projection and its types."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.contract.capabilities import SyncRole
from drivers.contract.device import AddressError, DeviceError, DeviceState, SdkMissingError
from drivers.contract.frame import Geometry, Kind, Reference
from drivers.orbbec import discover, library, open_device
from drivers.orbbec.device import OrbbecDevice
from tests.drivers.orbbec import takes
from tests.drivers.orbbec.bag import bag
from tests.drivers.recording_sink import RecordingSink

pytest.importorskip("rosbags", reason="make all")
try:
    ob = library.load()
except SdkMissingError as error:
    pytest.skip(str(error), allow_module_level=True)


@pytest.fixture(scope="module")
def take(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("orbbec") / "take.bag"
    takes.write(path, "CL8FC3100XX", images=20)
    return path


@pytest.fixture
def device(take: Path) -> Iterator[OrbbecDevice]:
    opened = open_device(f"orbbec://?recording={take}", time.monotonic_ns)
    yield opened
    opened.close()


def test_a_context_that_is_not_needed_ends_at_once() -> None:
    """One of about sixty took a minute: `devices` did, and so did the wait for a camera that is not attached."""
    longest_s = 0.0
    for _ in range(60):
        context = library.context(ob)
        began_s = time.monotonic()
        del context
        longest_s = max(longest_s, time.monotonic() - began_s)
    assert longest_s < 10


def test_every_stream_arrives_in_si_units_on_the_cameras_clock(device: OrbbecDevice) -> None:
    sink = RecordingSink()
    device.start(sink)
    sink.wait(lambda: (DeviceState.CLOSED, "the recording has ended") in sink.states)
    assert (device.info.serial, device.info.firmware, device.info.link) == ("CL8FC3100XX", "1.1.2", "USB3.1")
    depths = sink.of("depth")
    assert [round(frame.si()[5, 5] * 1000) for frame in depths] == [1000 + frame.seq for frame in depths]
    assert len(depths) >= 15  # it plays in real time, and a busy machine is late
    depth = depths[-1]
    assert np.all(np.isnan(depth.si()[0]))
    assert (depth.geometry, depth.t_reference, depth.clock_domain) == (Geometry.Z, Reference.MIDDLE, "orbbec")
    assert (depth.tick_hz, depth.t_device_ticks) == (1e6, takes.BEGIN_US + 20_000 * depth.seq)
    (ir,), (color,) = ({frame.key for frame in sink.of(name)} for name in ("ir", "color"))
    assert (ir, color) == (("depth", "ir"), ("color", "color"))
    assert {frame.encoding for frame in sink.of("color")} == {"rgb8"}
    assert all(int(frame.data[3, 3, 2]) == frame.seq for frame in sink.of("color"))


def test_lenses_and_poses_project_as_the_sdk_does(device: OrbbecDevice, take: Path) -> None:
    playback = ob.PlaybackDevice(str(take))
    profiles = {kind: _profile(playback, kind) for kind in ("DEPTH_SENSOR", "COLOR_SENSOR")}
    depth, color = profiles["DEPTH_SENSOR"], profiles["COLOR_SENSOR"]
    to_color = depth.get_extrinsic_to(color)
    for point in ([0.1, -0.05, 0.8], [-0.12, 0.1, 0.9], [0.03, 0.07, 0.6]):
        millimetres = ob.OBPoint3f(*(1000 * value for value in point))
        expected = ob.transformation3dto2d(millimetres, color.get_intrinsic(), color.get_distortion(), to_color)
        np.testing.assert_allclose(
            device.cameras["color"].project(np.array(point)), (expected.x, expected.y), atol=1e-3
        )


def _profile(playback: Any, kind: str) -> Any:
    profiles = playback.get_sensor(ob.OBSensorType.__members__[kind]).get_stream_profile_list()
    return profiles.get_default_video_stream_profile()


def test_a_lens_of_another_model_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fisheye.bag"
    with bag(path) as writer:
        writer.device("1")
        writer.setting(0, takes.VERSION)
        writer.profile(replace(takes.DEPTH, model=5))
        writer.image(takes.DEPTH, 0, takes.BEGIN_US, np.zeros((24, 32), "<u2"))
    with pytest.raises(DeviceError, match="depth/depth: distortion KANNALA_BRANDT4 is none of BROWN_CONRADY"):
        open_device(f"orbbec://?recording={path}", time.monotonic_ns)


def test_a_stereo_camera_has_two_imagers_a_unit_of_its_own_and_says_its_filters(tmp_path: Path) -> None:
    path, sink = tmp_path / "stereo.bag", RecordingSink()
    takes.write_stereo(path, images=20)
    device = open_device(f"orbbec://?recording={path}", time.monotonic_ns)
    try:
        device.start(sink)
        sink.wait(lambda: len({frame.key for frame in sink.frames}) == 3)
    finally:
        device.close()
    depth = sink.of("depth")[0]
    assert depth.si()[3, 3] == pytest.approx((10_000 + depth.seq) * 1e-4)
    assert depth.filters == ("noise_removal",)
    assert {frame.key for frame in sink.of("ir")} == {("left", "ir"), ("right", "ir")}
    assert device.cameras["right"].T_rs[:3, 3] == pytest.approx([takes.BASELINE_MM * 1e-3, 0, 0], abs=1e-6)
    np.testing.assert_allclose(device.cameras["left"].T_rs, np.eye(4), atol=1e-6)


def test_a_stream_without_a_pose_is_named(tmp_path: Path) -> None:
    path = tmp_path / "poses.bag"
    with bag(path) as writer:
        writer.device("1")
        writer.setting(0, takes.VERSION)
        for stream in (takes.COLOR, takes.RIGHT):
            writer.profile(stream)
            writer.image(stream, 0, takes.BEGIN_US, np.zeros(stream.size[::-1], np.uint8))
    with pytest.raises(DeviceError, match=r"color/color: the camera tells no pose of it .*; leave it out"):
        open_device(f"orbbec://?recording={path}", time.monotonic_ns)


def test_images_that_the_sdk_leaves_out_are_counted(tmp_path: Path) -> None:
    path, sink = tmp_path / "gaps.bag", RecordingSink()
    with bag(path) as writer:
        writer.device("1")
        writer.setting(0, takes.VERSION)
        writer.profile(takes.IR)
        for number in (0, 1, 5, 6):
            writer.image(takes.IR, number, takes.BEGIN_US + 20_000 * number, np.zeros((24, 32), "<u2"))
    device = open_device(f"orbbec://?recording={path}", time.monotonic_ns)
    try:
        device.start(sink)
        sink.wait(lambda: len(sink.frames) == 4)
        assert device.counters["missing"] == 3
    finally:
        device.close()


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("depth=640x576", "depth/depth has no 640x576; it has: 32x24@50"),
        ("color=40x30@15", "color/color has no 40x30@15; it has: 40x30@50"),
        ("depth=0&ir=0&color=0", "no stream of depth, infra-red, confidence or colour"),
    ],
)
def test_what_a_camera_does_not_have_is_named(take: Path, query: str, complaint: str) -> None:
    with pytest.raises(DeviceError, match=complaint):
        open_device(f"orbbec://?recording={take}&{query}", time.monotonic_ns)


def test_a_file_that_is_no_recording_is_a_final_error(tmp_path: Path) -> None:
    (tmp_path / "x.bag").write_bytes(b"hello\n" * 100)
    with pytest.raises(AddressError, match=r"x.bag cannot be played"):
        open_device(f"orbbec://?recording={tmp_path / 'x.bag'}", time.monotonic_ns)


def test_no_camera_raises() -> None:
    assert discover(0.1) == []
    with pytest.raises(DeviceError, match="no orbbec device is attached"):
        open_device("orbbec://", time.monotonic_ns)
    with pytest.raises(DeviceError, match="orbbec://CL8 is not attached"):
        open_device("orbbec://CL8", time.monotonic_ns)
    with pytest.raises(DeviceError, match=r"orbbec://127.0.0.1: .*127.0.0.1"):
        open_device("orbbec://127.0.0.1", time.monotonic_ns)


def test_the_sdk_prints_nothing_and_leaves_no_files(tmp_path: Path) -> None:
    code = "from drivers.orbbec import discover; print(discover(0.1))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[]\n", "")
    assert list(tmp_path.iterdir()) == []


def test_a_closed_camera_can_be_opened_again_while_its_device_is_still_held(device: OrbbecDevice, take: Path) -> None:
    def handles() -> int:
        return [link.readlink() for link in Path("/proc/self/fd").iterdir() if link.is_symlink()].count(take)

    device.start(RecordingSink())
    assert handles() == 1
    device.close()
    assert handles() == 0


def test_a_recording_has_controls_only_of_what_can_be_changed(device: OrbbecDevice) -> None:
    assert device.controls.infos == ()
    assert device.capabilities.sync_roles == (SyncRole.FREE,)
    assert not device.capabilities.regular
    assert {stream.kind for stream in device.capabilities.streams} == {Kind.DEPTH, Kind.IR, Kind.COLOR}

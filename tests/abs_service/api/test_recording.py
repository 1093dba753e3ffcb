"""Recordings and rig files, from outside."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState

import abs_service as a
from abs_service import cli
from drivers.encoding.mcap_file import McapFile

ROOT = Path(__file__).parents[3]
SAMPLE = ROOT / "recordings" / "sample.mcap"
RIGS = sorted(ROOT.glob("examples/rigs/*.toml"))


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    """The sample and the estimates of its own tracker."""
    recording = a.open_recording(SAMPLE)
    return recording, list(recording.rig.tracker().replay(recording))


def test_a_recording_lists_what_it_holds():
    recording = a.open_recording(str(SAMPLE))
    assert dict(recording.streams) == {"tof/depth": 15, "tof/amplitude": 15, "color/color": 15}
    assert (recording.trackers, recording.truncated) == ((), False)
    assert recording.duration_s == pytest.approx(28 / 15)
    assert (recording.cameras["tof"].width, recording.cameras["color"].height) == (88, 96)
    assert recording.rig.trackers == ("sheet",)


def test_images_are_arrays_in_si_units():
    images = list(a.open_recording(SAMPLE).images())
    assert len(images) == 45
    assert [image.time_s for image in images] == sorted(image.time_s for image in images)
    depth, amplitude, color = (
        next(image for image in images if image.stream == name)
        for name in ("tof/depth", "tof/amplitude", "color/color")
    )
    assert depth.values.shape == amplitude.values.shape == (72, 88)
    assert (color.values.shape, color.values.dtype) == ((96, 128, 3), np.uint8)
    assert depth.values.dtype == np.float32
    assert 0.2 < np.nanmedian(depth.values) < 5
    assert (depth.geometry, color.geometry) == ("radial", "none")


def test_images_of_some_streams_only():
    assert {image.stream for image in a.open_recording(SAMPLE).images("color/color")} == {"color/color"}
    with pytest.raises(a.ArgumentError, match=r"streams = 'tof/color': must be in .*sample\.mcap, which has tof/depth"):
        a.open_recording(SAMPLE).images("tof/color")


def test_a_recording_can_be_tracked(replayed):
    recording, estimates = replayed
    assert len(estimates) == 15
    assert {estimate.status for estimate in estimates} == {"TRACKING"}
    assert estimates[0].time_s == pytest.approx(next(recording.images("tof/depth")).time_s)


def test_arrays_of_a_recording_give_the_same_estimates(replayed):
    recording, estimates = replayed
    tracker = recording.rig.tracker("sheet", geometry="radial")
    streams = (recording.images(name) for name in ("tof/depth", "tof/amplitude", "color/color"))
    for (depth, amplitude, color), expected in zip(zip(*streams), estimates[:4]):
        found = tracker.track(depth.values, time_s=depth.time_s, amplitude=amplitude.values, image=color.values)
        assert np.allclose(found.theta, expected.theta, atol=1e-6)


def test_recorded_estimates_are_those_of_the_tracker(replayed, tmp_path):
    estimates = replayed[1]
    file = tmp_path / "sample.mcap"
    shutil.copy(SAMPLE, file)
    # In this process: kernels from the cache, and kernels compiled here, differ in the last bits of their sums.
    assert cli.main(["replay", str(file)]) == 0
    recording = a.open_recording(tmp_path / "sample_replay.mcap")
    assert recording.trackers == ("sheet",)
    recorded = list(recording.estimates())
    for one, other in zip(recorded, estimates, strict=True):
        assert np.allclose(one.theta, other.theta, atol=1e-6)
        assert np.allclose(one.covariance, other.covariance, rtol=1e-3)
        assert np.allclose(one.vertices, other.vertices, atol=1e-6)
        assert np.allclose(one.vertex_covariance, other.vertex_covariance, rtol=1e-3, atol=1e-12)
        assert np.allclose(one.undeformed, other.undeformed, atol=1e-6)
        assert np.array_equal(one.faces, other.faces)
        assert (one.status, one.mesh_version) == (other.status, other.mesh_version)
        assert one.time_s == pytest.approx(other.time_s)
        assert one.residuals == pytest.approx(other.residuals)
    with pytest.raises(a.RecordingError, match="there are no images in this file"):
        recording.images()


def test_a_file_that_is_no_recording_is_refused(tmp_path):
    with pytest.raises(a.RecordingError, match="No such file"):
        a.open_recording(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no MCAP")
    with pytest.raises(
        a.RecordingError,
        match=r"this is no MCAP file .* its beginning is damaged; `abs-service recover` .* `abs-service import` reads",
    ):
        a.open_recording(tmp_path / "text.mcap")


def test_estimates_of_a_tracker_that_was_not_recorded():
    with pytest.raises(a.ArgumentError, match=r"tracker = 'sheet': .*\.mcap has no estimates; `abs-service replay`"):
        a.open_recording(SAMPLE).estimates("sheet")


def test_a_recording_without_an_image_that_the_tracker_uses():
    camera = a.Camera(88, 72, fx=100, fy=100, cx=44, cy=36)
    with pytest.raises(a.ArgumentError, match=r"sample\.mcap: must have depth/depth; it has tof/depth, tof/ampl"):
        list(a.Tracker(camera, a.Rigid()).replay(a.open_recording(SAMPLE)))


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_rig_file_of_the_examples_can_be_loaded(path):
    rig = a.load_rig(path)
    assert rig.sensors
    assert set(rig.noise) <= set(rig.sensors)
    for name in rig.trackers:
        if not set(rig.cameras) >= set(rig.sensors):
            with pytest.raises(a.ArgumentError, match=r'cameras = {}: must have one of ".+", a sensor of tracker ".+"'):
                rig.tracker(name)


def test_a_tracker_of_a_rig_file_takes_the_cameras_that_it_is_given():
    depth, color = a.Camera(640, 480, 580, 580, 320, 240), a.Camera(640, 480, 525, 525, 320, 240)
    tracker = a.load_rig(ROOT / "examples" / "rigs" / "kinect.toml").tracker(cameras={"depth": depth, "color": color})
    depth_m = np.full((480, 640), 0.8)
    depth_m[:, :200] = depth_m[:, 440:] = depth_m[:100] = depth_m[380:] = np.nan
    mosaic = np.full((480, 640), 128, np.uint8)
    estimate = tracker.track(depth_m, time_s=0, image=mosaic)
    assert (estimate.status, estimate.theta.shape) == ("TRACKING", (3 * 6 * 6,))


def test_a_rig_file_says_where_its_cameras_are(tmp_path):
    file = tmp_path / "rig.toml"
    camera = "{ width = 64, height = 48, fx = 60.0, fy = 60.0, cx = 31.5, cy = 23.5 }"
    text = (ROOT / "examples" / "rigs" / "kinect.toml").read_text(encoding="utf-8")
    file.write_text(text.replace("[sensors.depth]", f"[sensors.depth]\ncamera = {camera}"), encoding="utf-8")
    rig = a.load_rig(file)
    assert list(rig.cameras) == ["depth"]
    assert (rig.cameras["depth"].width, rig.name) == (64, "kinect")
    assert isinstance(rig.noise["depth"], a.noise.StructuredLight)


def test_a_name_that_the_rig_does_not_have():
    rig = a.load_rig(ROOT / "examples" / "rigs" / "two_trackers.toml")
    with pytest.raises(a.ArgumentError, match=rf"name = 'x': must be a tracker of the rig, {', '.join(rig.trackers)}"):
        rig.tracker("x")
    with pytest.raises(a.ArgumentError, match="name = '': must be a tracker of the rig, "):
        rig.tracker()


def test_a_rig_file_with_a_mistake_is_refused(tmp_path):
    (tmp_path / "rig.toml").write_text('version = 1\nname = "x"\nfoo = 1\n', encoding="utf-8")
    with pytest.raises(a.ConfigError, match=r"rig\.toml: \d(.|\n)*foo: unknown key"):
        a.load_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("changes", [{"payload": b"\xff"}, {"status": 99}, {"covariance_valid": True, "theta": [1.0]}])
def test_what_is_no_estimate_is_named(changes, tmp_path):
    state = DeformationState(**changes) if "payload" not in changes else None
    payload = state.SerializeToString() if state else changes["payload"]
    with (tmp_path / "x.mcap").open("wb") as stream:
        file = McapFile(stream)
        file.write("/sheet/state", DeformationState.DESCRIPTOR.full_name, payload, 0, 0)
        file.finish()
    with pytest.raises(a.RecordingError, match=r"x\.mcap: an estimate of sheet is malformed"):
        list(a.open_recording(tmp_path / "x.mcap").estimates())

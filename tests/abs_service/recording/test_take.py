"""The file of estimates beside a recording: what is in it, and that it shares the recording's fate."""

import json
import threading

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

import abs_service as a
from abs_service import cli
from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.capture import sensor_metadata
from abs_service.recording.recording_file import free_path, open_for_writing
from abs_service.recording.recovery import recover
from calib.camera import Camera
from tests.abs_service.recording.recorder_rig import Rig, depth, metadata, read, recordings, sequences
from tests.waiting import eventually

CAMERA = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)


def publish(rig, seq):
    """All that a rig says of one moment."""
    rig.publish_image(depth(seq))
    header = Header(seq=seq, rig="demo", boot_id="b", t_host_ns=seq)
    header.stamp.FromNanoseconds(rig.clock.wall(rig.clock.monotonic()))
    tracked = DeformationState.STATUS_TRACKING
    for topic, message in {
        keys.topology("sheet"): MeshTopology(header=header, tracker="sheet", mesh_version=1),
        keys.state("sheet"): DeformationState(header=header, tracker="sheet", status=tracked, mesh_version=1),
        keys.mesh("sheet"): DeformedMesh(header=header, tracker="sheet", mesh_version=1, vertices_f32=bytes(12)),
        keys.scene("sheet"): SceneUpdate(),
        keys.points("tof/depth/image"): PointCloud(),
        keys.truth("sim"): SurfaceTruth(header=header),
    }.items():
        rig.bus.deliver(Sample(topic, message.DESCRIPTOR.full_name, message.SerializeToString()))


def announce(rig):
    header = rig.headers.now(0)
    for topic, message in {
        keys.CONFIG: sensor_metadata.config(header, "version = 1"),
        keys.calibration("tof"): sensor_metadata.calibration("tof", CAMERA, 1),
        keys.model("tof"): sensor_metadata.sensor_model(header, "tof", CAMERA, {"type": "x"}),
        keys.TRANSFORMS: sensor_metadata.transforms({"tof": CAMERA}, 1),
    }.items():
        rig.bus.latched_publisher(topic, message.DESCRIPTOR.full_name).put(message.SerializeToString())


def recorded(directory, **settings):
    """A rig that was recorded for five moments: its recording and the file of the estimates."""
    rig = Rig(directory, estimates=True, **settings)
    announce(rig)
    rig.recorder.start()
    for seq in range(5):
        publish(rig, seq)
    rig.health.publish()
    rig.recorder.stop(5)
    (everything,) = (path for path in recordings(directory) if not path.stem.endswith("_estimates"))
    return everything, everything.with_name(f"{everything.stem}_estimates.mcap")


def test_everything_but_images_and_truth_is_in_the_file_of_estimates(tmp_path):
    everything, estimates = recorded(tmp_path)
    messages, attachments, _ = read(estimates)
    latched = {"/config", "/tof/calibration", "/tof/model", "/tf"}
    assert {m.channel.topic for m in messages} == latched | {
        "/sheet/state",
        "/sheet/mesh",
        "/sheet/topology",
        "/health/record",
    }
    assert attachments == read(everything)[1]
    assert json.loads(attachments["calibration/tof.json"])["calib_id"] == CAMERA.calib_id
    said = metadata(estimates)
    assert (said["ended"], said["messages.sheet/state"]) == ("stopped", "5")
    assert "messages.tof/depth/image" not in said
    assert metadata(everything)["messages.tof/depth/image"] == "5"
    own = [m.message for m in messages]
    of_all = [m.message for m in read(everything)[0] if m.channel.topic in {one.channel.topic for one in messages}]
    assert [(m.data, m.log_time) for m in own] == [(m.data, m.log_time) for m in of_all]


def test_tools_read_it_as_any_recording(tmp_path, capsys):
    _, estimates = recorded(tmp_path)
    recording = a.open_recording(estimates)
    assert recording.trackers == ("sheet",)
    assert [one.status for one in recording.estimates()] == [a.Status.TRACKING] * 5
    assert cli.main(["info", str(estimates), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["trackers"]["sheet"]["estimates"] == 5
    assert cli.main(["export", str(estimates), "--out", str(tmp_path / "x.csv")]) == 0
    assert len((tmp_path / "x.csv").read_text().splitlines()) > 5
    assert cli.main(["replay", str(estimates)]) == 2
    assert "there are no images in this file" in capsys.readouterr().err


def test_there_is_none_unless_it_was_asked_for(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    publish(rig, 1)
    rig.recorder.stop(5)
    assert len(list(tmp_path.iterdir())) == 1


def test_both_begin_anew_together_and_no_estimate_is_lost(tmp_path):
    rig = Rig(tmp_path, estimates=True, rotate_bytes=1, flush_s=0.001)
    rig.recorder.start()
    seq = 0
    while len(recordings(tmp_path)) < 6:
        publish(rig, seq := seq + 1)
        threading.Event().wait(0.005)
    rig.recorder.stop(5)
    names = {path.stem for path in recordings(tmp_path)}
    assert {f"{name}_estimates" for name in names if not name.endswith("_estimates")} <= names
    found = [
        m.message.sequence
        for path in tmp_path.glob("*_estimates.mcap")
        for m in read(path)[0]
        if m.channel.topic == "/sheet/state"
    ]
    assert sorted(found) == list(range(1, seq + 1))


class Full:
    """A disk that takes no more than some bytes of a file."""

    def __init__(self, path, limit):
        self._file, self._limit = path.open("xb"), limit

    def write(self, data):
        if self._file.tell() > self._limit:
            raise OSError(28, "No space left on device")
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_a_disk_that_fails_with_the_estimates_leaves_both_to_be_recovered(tmp_path):
    def open_file(path):
        is_first = len(list(tmp_path.iterdir())) < 2
        return Full(path, 8000) if "_estimates" in path.name and is_first else open_for_writing(path)

    rig = Rig(tmp_path, estimates=True, open_file=open_file, flush_s=0.005)
    rig.recorder.start()
    seq = 0
    while not rig.recorder.failures:
        publish(rig, seq := seq + 1)
        threading.Event().wait(0.001)
    publish(rig, seq := seq + 1)
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    left = list(tmp_path.glob("*.active"))
    assert len(left) == 2
    for path in left:
        recover(path)
    saved = sequences(tmp_path)
    assert saved[-1] == seq
    assert seq - len(saved) <= rig.said.counters["unsaved"]


@pytest.mark.parametrize("limit", [-1, 100])
def test_a_disk_that_takes_no_beginning_of_the_estimates_is_not_littered(tmp_path, limit):
    rig = Rig(tmp_path, estimates=True, open_file=lambda path: Full(path, 1e9 if "_est" not in path.name else limit))
    rig.recorder.start()
    assert eventually(lambda: rig.recorder.failed)
    rig.recorder.stop(5)
    assert not list(tmp_path.iterdir())


def test_a_file_of_estimates_that_is_taken_away_is_noticed(tmp_path):
    rig = Rig(tmp_path, estimates=True, flush_s=0.005)
    rig.recorder.start()
    publish(rig, 1)
    assert eventually(lambda: rig.written(1))
    (active,) = tmp_path.glob("*_estimates.mcap.active")
    active.unlink()
    assert eventually(lambda: rig.recorder.failures == 1)
    assert rig.said.labels["last_failure"] == f"{active.stem} was deleted while it was written"
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert sequences(tmp_path) == [1]


def test_no_recording_takes_the_name_of_one_whose_estimates_are_left(tmp_path):
    first = free_path(tmp_path, "demo", 0)
    (tmp_path / f"{first.stem}_estimates.mcap").touch()
    assert free_path(tmp_path, "demo", 0).name == f"{first.stem}_2.mcap"

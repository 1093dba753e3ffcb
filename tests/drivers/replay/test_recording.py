"""Offline reading of recordings, in order, also from truncated and corrupt files."""

import dataclasses
import json
import os
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import MCAP0_MAGIC, IndexType, Writer

from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec, mcap_file
from drivers.encoding.mcap_file import McapFile
from drivers.replay import Recording, RecordingError
from drivers.replay.contents import scan
from tests.drivers.replay.recordings import (
    BOOT_NS,
    CAMERAS,
    WALL_NS,
    damage,
    recorded,
    write,
    write_item,
    write_malformed,
    write_model,
)


def assert_same(left: Iterable[Frame | Truth], right: Iterable[Frame | Truth]) -> None:
    left, right = list(left), list(right)
    assert len(left) == len(right)
    for a, b in zip(left, right):
        assert type(a) is type(b)
        assert (a.seq, a.t_host_ns) == (b.seq, b.t_host_ns)
        if isinstance(a, Frame) and isinstance(b, Frame):
            assert (a.key, a.scale, a.geometry, a.invalid) == (b.key, b.scale, b.geometry, b.invalid)
            np.testing.assert_array_equal(a.data, b.data)
        elif isinstance(a, Truth) and isinstance(b, Truth):
            np.testing.assert_array_equal(a.points_r, b.points_r)


def test_frames_and_truths_are_read_in_order(tmp_path: Path) -> None:
    items = recorded(10)
    recording = Recording(write(tmp_path / "a.mcap", items))
    assert_same(recording.frames(), items)
    assert_same(recording.frames(), items)  # again, from the beginning
    assert not recording.truncated
    assert recording.unpaired == 0
    assert recording.config == 'name = "demo"\n'
    assert recording.counts == {("tof", "depth"): 10, ("tof", "amplitude"): 10, ("color", "color"): 10}
    assert recording.duration_s == pytest.approx(BOOT_NS * 1e-9 + 9 / 30)
    assert {name: camera.calib_id for name, camera in recording.cameras.items()} == {
        name: camera.calib_id for name, camera in CAMERAS.items()
    }
    assert recording.models["tof"].noise == "gaussian_polynomial"


def test_the_rate_of_a_stream_begins_with_its_first_frame(tmp_path: Path) -> None:
    recording = Recording(write(tmp_path / "x.mcap", recorded(4)))
    times = [item.t_host_ns for item in recording.frames() if isinstance(item, Frame) and item.sensor == "tof"]
    period_s = (max(times) - min(times)) * 1e-9 / 3
    assert recording.duration_s > 6 * period_s, "the calibrations come long before"
    assert recording.rate_hz(recording.first_frames()["tof", "depth"]) == pytest.approx(1 / period_s, rel=0.05)


def test_late_messages_are_sorted(tmp_path: Path) -> None:
    items = recorded(30)
    late = [item for item in items if isinstance(item, Frame) and item.sensor == "color" and item.seq < 10]
    rest = [item for item in items if not any(item is other for other in late)]
    recording = Recording(write(tmp_path / "a.mcap", [*rest[:60], *late, *rest[60:]]))
    times = [item.t_host_ns for item in recording.frames()]
    assert len(times) == len(items)
    assert times == sorted(times)


def test_a_killed_recorder_leaves_a_readable_file(tmp_path: Path) -> None:
    items = recorded(10)
    recording = Recording(write(tmp_path / "a.mcap", items, finish=False))
    assert recording.truncated
    assert_same(recording.frames(), items)
    assert recording.config == 'name = "demo"\n'
    assert recording.cameras.keys() == {"tof", "color"}


@pytest.mark.parametrize("share", [0.3, 0.5, 0.77, 0.95])
def test_a_truncated_file_is_read_up_to_the_truncation(tmp_path: Path, share: float) -> None:
    items = recorded(20)
    path = write(tmp_path / "a.mcap", items)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    recording = Recording(path)
    found = list(recording.frames())
    assert recording.truncated
    assert len(found) >= (share - 0.2) * len(items)
    assert sum(recording.counts.values()) >= sum(isinstance(item, Frame) for item in found)
    assert recording.unpaired <= 1
    assert {(item.seq, type(item)) for item in found} <= {(item.seq, type(item)) for item in items}


def test_a_corrupt_chunk_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(20))
    damage(path)
    recording = Recording(path)
    with pytest.raises(RecordingError, match=r"a\.mcap: the chunk at byte \d+ is damaged .*`abs-service recover`"):
        list(recording.frames())


def test_corrupt_chunks_of_an_unfinished_file_are_skipped_and_counted(tmp_path: Path) -> None:
    items = recorded(20)
    path = write(tmp_path / "a.mcap", items, finish=False)
    assert Recording(path).damaged_chunks == 0
    damage(path)
    recording = Recording(path)
    assert (recording.truncated, recording.damaged_chunks) == (True, 1)
    assert 0 < len(list(recording.frames())) < len(items)


def test_an_image_without_metadata_is_counted(tmp_path: Path) -> None:
    items = recorded(3)
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        file = McapFile(stream)
        for item in items:
            write_item(file, item)
        frame = dataclasses.replace(next(item for item in items if isinstance(item, Frame)), seq=99)
        file.write("/tof/depth/image", codec.IMAGE_SCHEMA, codec.encode_image(frame, WALL_NS), WALL_NS, 99)
        file.finish()
    recording = Recording(path)
    assert_same(recording.frames(), items)
    assert recording.unpaired == 1


def test_a_malformed_frame_is_left_out_counted_and_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    items = recorded(2)
    recording = Recording(write_malformed(tmp_path / "a.mcap", items))
    assert_same(recording.frames(), items)
    assert recording.malformed == 1
    assert "a.mcap: /color/color/info at" in caplog.text
    assert "2 bytes are no foxglove.RawImage" in caplog.text


def test_frames_of_other_streams_are_not_decoded(tmp_path: Path) -> None:
    items = recorded(2)
    recording = Recording(write_malformed(tmp_path / "a.mcap", items))
    depths = [item for item in items if not isinstance(item, Frame) or item.key == ("tof", "depth")]
    assert_same(recording.frames([("tof", "depth")]), depths)
    assert recording.malformed == 0


@pytest.mark.parametrize(
    "left_out",
    [{"use_statistics": False}, {"index_types": IndexType.NONE}, {"use_statistics": False, "repeat_channels": False}],
)
def test_a_writer_may_leave_out_parts_of_the_index(tmp_path: Path, monkeypatch, left_out) -> None:
    monkeypatch.setattr(mcap_file, "Writer", partial(Writer, **left_out))
    items = recorded(3)
    recording = Recording(write(tmp_path / "a.mcap", items))
    assert_same(recording.frames(), items)
    assert not recording.truncated
    assert recording.cameras.keys() == {"tof", "color"}


def test_messages_outside_of_chunks_are_for_recover(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(mcap_file, "Writer", partial(Writer, use_chunking=False))
    with pytest.raises(RecordingError, match=r"a\.mcap: it has messages outside of chunks; `abs-service recover`"):
        Recording(write(tmp_path / "a.mcap", recorded(1)))


@pytest.mark.parametrize(("last", "changed"), [("", []), ("another", ["tof"])])
def test_a_sensor_of_which_another_calibration_follows_is_named(tmp_path: Path, last: str, changed: list[str]) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        file = McapFile(stream)
        write_item(file, recorded(1)[1])
        write_model(file, "tof", CAMERAS["tof"], calib_id="first")
        for calib_id in ("first", last or "first"):
            text = json.dumps({"sensor": "tof", "calib_id": calib_id}).encode()
            file.attach("calibration/tof.json", "application/json", text, WALL_NS)
        file.finish()
    assert Recording(path).recalibrated == changed


def foreign(path: Path) -> None:
    with path.open("wb") as stream:
        file = McapFile(stream)
        file.write("/camera/left/image", "foxglove.RawImage", RawImage().SerializeToString(), 0, 0)
        file.finish()


def empty(path: Path) -> None:
    with path.open("wb") as stream:
        McapFile(stream).finish()


def lying(path: Path) -> None:
    with path.open("wb") as stream:
        file = McapFile(stream)
        file.write("/a/b/image", codec.IMAGE_SCHEMA, b"", 0, 0)
        file.write("/a/b/info", codec.INFO_SCHEMA, b"", 0, 0)
        file.finish()


def impossible(path: Path) -> None:
    with path.open("wb") as stream:
        file = McapFile(stream)
        write_item(file, recorded(1)[1])
        write_model(file, "tof", CAMERAS["tof"], fx=-1.0)
        file.finish()


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda path: None, "No such file"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: path.write_bytes(b""), r"this is no MCAP file \(0 bytes\)"),
        (lambda path: path.write_bytes(b"PK" * 100), r"this is no MCAP file \(200 bytes\)"),
        (foreign, r"topic /camera/left/image holds images without absmsg\.v1\.FrameInfo"),
        (empty, r"there are no images in this file, its topics are \[\]"),
        (lying, r"/a/b/info at 0 ns: .*no names of a sensor"),
        (impossible, "the model of sensor 'tof' is no camera: f[xy] = .*: must be positive"),
    ],
)
def test_errors_name_the_file_and_the_problem(tmp_path: Path, make, complaint: str) -> None:
    path = tmp_path / "broken.mcap"
    make(path)
    with pytest.raises(RecordingError, match=rf"broken\.mcap: .*{complaint}|broken\.mcap: {complaint}"):
        list(Recording(path).frames())


def test_a_file_that_ends_after_its_first_bytes_is_not_finished(tmp_path: Path) -> None:
    path = tmp_path / "begun.mcap"
    path.write_bytes(MCAP0_MAGIC)
    contents = scan(path)
    assert contents.truncated
    assert not contents.chunks


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path) -> None:
    os.mkfifo(path := tmp_path / "pipe.mcap")
    with pytest.raises(RecordingError, match=r"pipe\.mcap: it is no regular file"):
        scan(path)

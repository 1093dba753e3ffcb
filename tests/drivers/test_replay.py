"""A recording gives back what was recorded, in order, whatever happened to the file; a replay keeps its pace."""

import dataclasses
import threading
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from abs.v1.common_pb2 import Header
from abs.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from calib.camera import Camera
from drivers import codec
from drivers.device import AddressError, DeviceState, Truth
from drivers.frame import Frame
from drivers.mcap_file import Compression, McapFile
from drivers.opening import open_device
from drivers.replay import Recording, RecordingError, ReplayDevice
from drivers.replay.contents import survey
from drivers.simulated.address import parse

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
CAMERAS = {name: head.camera for name, head in SIMULATION.heads.items()}
WALL_NS = 1_700_000_000_000_000_000
BOOT_NS = 3_000_000_000


def recorded(count: int) -> list[Frame | Truth]:
    items: list[Frame | Truth] = []
    for k in range(count):
        frames, truth = SIMULATION.expose(k)
        items += [dataclasses.replace(item, t_host_ns=item.t_host_ns + BOOT_NS) for item in (truth, *frames)]
    return items


def write_item(file: McapFile, item: Frame | Truth) -> None:
    wall_ns = item.t_host_ns + WALL_NS
    header = Header(rig="demo", seq=item.seq)
    if isinstance(item, Truth):
        file.write("/sim/truth", codec.TRUTH_SCHEMA, codec.encode_truth(item, header), wall_ns, item.seq)
        return
    base = f"/{item.sensor}/{item.stream}"
    file.write(f"{base}/image", codec.IMAGE_SCHEMA, codec.encode_image(item, wall_ns), wall_ns, item.seq)
    file.write(f"{base}/info", codec.INFO_SCHEMA, codec.encode_info(item, header), wall_ns, item.seq)


def write_model(file: McapFile, sensor: str, camera: Camera, **changes: object) -> None:
    model = SensorModel(
        sensor=sensor,
        width=camera.width,
        height=camera.height,
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        lens=camera.lens.coefficients.tolist(),
        T_rs=camera.T_rs.ravel().tolist(),
        noise="gaussian_polynomial",
    )
    for name, value in changes.items():
        setattr(model, name, value)
    file.write(f"/{sensor}/model", "abs.v1.SensorModel", model.SerializeToString(), WALL_NS, 0)


def write(
    path: Path, items: Iterable[Frame | Truth], *, finish: bool = True, sensors: tuple[str, ...] = ("tof", "color")
) -> Path:
    with path.open("wb") as stream:
        file = McapFile(stream, Compression.LZ4, chunk_size=20_000)
        file.attach("rig.toml", "text/toml", b'name = "demo"\n', WALL_NS)
        for sensor in sensors:
            write_model(file, sensor, CAMERAS[sensor])
        for item in items:
            write_item(file, item)
        file.finish() if finish else file.flush()
    return path


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


def test_everything_comes_back_in_order(tmp_path: Path) -> None:
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


def test_messages_that_were_written_late_are_put_in_their_place(tmp_path: Path) -> None:
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
def test_a_truncated_file_gives_what_is_there(tmp_path: Path, share: float) -> None:
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


def damage(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    inside = survey(path).chunks[5].offset + 1000
    whole[inside : inside + 50] = bytes(50)
    path.write_bytes(whole)


def test_a_damaged_chunk_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(20))
    damage(path)
    recording = Recording(path)
    with pytest.raises(RecordingError, match=r"a\.mcap: the chunk at byte \d+ is damaged .*`abs-service recover`"):
        list(recording.frames())


def test_damaged_chunks_of_an_unfinished_file_are_left_out_and_counted(tmp_path: Path) -> None:
    items = recorded(20)
    path = write(tmp_path / "a.mcap", items, finish=False)
    assert Recording(path).damaged_chunks == 0
    damage(path)
    recording = Recording(path)
    assert (recording.truncated, recording.damaged_chunks) == (True, 1)
    assert 0 < len(list(recording.frames())) < len(items)


def test_an_image_without_its_description_is_counted(tmp_path: Path) -> None:
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
        (foreign, r"topic /camera/left/image holds images that no abs\.v1\.FrameInfo describes"),
        (empty, r"there are no images in this file, its topics are \[\]"),
        (lying, r"/a/b/info at 0 ns: FrameInfo names no sensor"),
        (impossible, "the model of sensor 'tof' is no camera: fx and fy must be positive"),
    ],
)
def test_errors_name_the_file_and_what_is_wrong(tmp_path: Path, make, complaint: str) -> None:
    path = tmp_path / "broken.mcap"
    make(path)
    with pytest.raises(RecordingError, match=rf"broken\.mcap: .*{complaint}|broken\.mcap: {complaint}"):
        list(Recording(path).frames())


class Sink:
    """Keeps what it gets, and tells when the replay ended or enough has come."""

    def __init__(self, enough: int = 1 << 30) -> None:
        self.items: list[Frame | Truth] = []
        self.states: list[tuple[DeviceState, str]] = []
        self.done = threading.Event()
        self.enough = enough

    def on_frame(self, frame: Frame) -> None:
        self.items.append(frame)
        if len(self.items) >= self.enough:
            self.done.set()

    def on_truth(self, truth: Truth) -> None:
        self.items.append(truth)

    def on_state(self, state: DeviceState, reason: str) -> None:
        self.states.append((state, reason))
        if state in {DeviceState.CLOSED, DeviceState.FAILED}:
            self.done.set()


class Time:
    """A clock that moves only when someone waits."""

    def __init__(self) -> None:
        self.now_ns = 77_000_000_000

    def clock(self) -> int:
        return self.now_ns

    def wait(self, stop: threading.Event, seconds: float) -> bool:
        self.now_ns += round(seconds * 1e9)
        return stop.is_set()


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_replay_keeps_its_pace_and_looks_like_now(tmp_path: Path, speed: float) -> None:
    items = recorded(6)
    time, sink = Time(), Sink()
    device = ReplayDevice("", Recording(write(tmp_path / "a.mcap", items)), speed, False, time.clock, time.wait)
    device.start(sink)
    assert sink.done.wait(30)
    device.stop()
    assert [item.seq for item in sink.items] == [item.seq for item in items]
    for original, item in zip(items, sink.items):
        assert item.t_host_ns == 77_000_000_000 + round((original.t_host_ns - BOOT_NS) / speed)
        if isinstance(item, Frame):
            assert 0 <= item.t_arrival_ns - item.t_host_ns < 10
            assert item.epoch == 0
    assert device.counters == {"frames": 18, "unpaired": 0}
    assert sink.states[-1] == (DeviceState.CLOSED, "the recording ended")
    assert [(s.sensor, s.stream) for s in device.streams] == [
        ("tof", "depth"),
        ("tof", "amplitude"),
        ("color", "color"),
    ]
    assert {(s.width, s.height) for s in device.streams} == {(32, 24)}


def test_a_replay_can_give_those_who_watch_time_to_get_ready(tmp_path: Path) -> None:
    time, sink = Time(), Sink()
    recording = Recording(write(tmp_path / "a.mcap", recorded(2)))
    device = ReplayDevice("", recording, 1.0, False, time.clock, time.wait, delay_s=6.0)
    device.start(sink)
    assert sink.done.wait(30)
    device.close()
    assert sink.items[0].t_host_ns == 77_000_000_000 + 6_000_000_000
    assert [state for state, _ in sink.states] == [DeviceState.OPENING, DeviceState.STREAMING, DeviceState.CLOSED]
    with pytest.raises(AddressError, match=r"delay = '-1' must be a number from 0 to 3600"):
        open_device(f"replay://{recording.path}?delay=-1", time.clock)


def test_every_round_of_a_loop_and_every_start_is_a_new_epoch(tmp_path: Path) -> None:
    items = [item if isinstance(item, Truth) else dataclasses.replace(item, epoch=7_000_000) for item in recorded(2)]
    time, sink = Time(), Sink(enough=20)
    device = ReplayDevice("", Recording(write(tmp_path / "a.mcap", items)), 1.0, True, time.clock, time.wait)
    device.start(sink)
    assert sink.done.wait(30)
    device.stop()
    assert sink.states[-1] == (DeviceState.CLOSED, "stopped")
    epochs = [item.epoch for item in sink.items if isinstance(item, Frame)]
    assert epochs[:13] == [0] * 6 + [1] * 6 + [2]
    again = Sink(enough=1)
    device.start(again)
    assert again.done.wait(30)
    device.close()
    first = next(item for item in again.items if isinstance(item, Frame))
    assert first.epoch > epochs[-1]


def test_a_replay_of_a_damaged_file_fails_with_the_reason(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(20))
    device = open_device(f"replay://{path}?speed=100", Time().clock)
    damage(path)
    sink = Sink()
    device.start(sink)
    assert sink.done.wait(30)
    device.close()
    state, reason = sink.states[-1]
    assert state == DeviceState.FAILED
    assert "is damaged" in reason


def test_a_relative_path_and_cameras(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "Some file.mcap", recorded(2))
    monkeypatch.chdir(tmp_path)
    device = open_device("replay://Some%20file.mcap?loop=1", Time().clock)
    assert device.cameras["color"].calib_id == CAMERAS["color"].calib_id
    assert device.info.serial == "Some file.mcap"


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("speed=0", r"speed = '0' must be a number from 0\.01 to 100"),
        ("speed=fast", r"speed = 'fast' must be"),
        ("loop=yes", r"loop = 'yes' must be 0 or 1"),
        ("pace=1", r"unknown key 'pace'; allowed are \['delay', 'loop', 'speed'\]"),
    ],
)
def test_addresses_are_strict(query: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(f"replay://a.mcap?{query}", Time().clock)


def test_a_sensor_without_a_model_cannot_be_replayed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(2), sensors=("tof",))
    assert Recording(path).cameras.keys() == {"tof"}
    with pytest.raises(AddressError, match=r"topic /color/model .* is missing"):
        open_device(f"replay://{path}", Time().clock)

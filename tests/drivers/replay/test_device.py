"""Real-time playback of recordings."""

import dataclasses
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from absmsg.v1.common_pb2 import Header

from abs_service.capture import mcap_writing
from drivers.contract.device import AddressError, DeviceState, Truth
from drivers.contract.frame import Frame
from drivers.encoding.mcap_file import McapFile
from drivers.opening import open_device
from drivers.replay import Recording, ReplayDevice
from drivers.replay.contents import RecordingError
from tests.drivers.manual_time import ManualTime
from tests.drivers.recording_sink import RecordingSink
from tests.drivers.replay.recordings import (
    BOOT_NS,
    CAMERAS,
    WALL_NS,
    damage,
    recorded,
    write,
    write_malformed,
    write_model,
)

BEGIN_NS = 77_000_000_000


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_replay_has_real_time_pace_and_current_times(tmp_path: Path, speed: float) -> None:
    items = recorded(6)
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    device = ReplayDevice("", Recording(write(tmp_path / "a.mcap", items)), speed, False, time.clock, time.wait)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.stop()
    assert [item.seq for item in sink.items] == [item.seq for item in items]
    for original, item in zip(items, sink.items):
        assert item.t_host_ns == BEGIN_NS + round((original.t_host_ns - BOOT_NS) / speed)
        if isinstance(item, Frame):
            assert 0 <= item.t_arrival_ns - item.t_host_ns < 10
            assert item.epoch == 0
    assert device.counters == {"frames": 18, "unpaired": 0, "malformed": 0}
    assert sink.states[-1] == (DeviceState.CLOSED, "the recording ended")
    assert [(s.sensor, s.stream) for s in device.capabilities.streams] == [
        ("tof", "depth"),
        ("tof", "amplitude"),
        ("color", "color"),
    ]
    assert {(s.width, s.height) for s in device.capabilities.streams} == {(32, 24)}


def test_a_replay_can_be_delayed(tmp_path: Path) -> None:
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    recording = Recording(write(tmp_path / "a.mcap", recorded(2)))
    device = ReplayDevice("", recording, 1.0, False, time.clock, time.wait, delay_s=6.0)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.close()
    assert sink.items[0].t_host_ns == BEGIN_NS + 6_000_000_000
    assert [state for state, _ in sink.states] == [DeviceState.OPENING, DeviceState.STREAMING, DeviceState.CLOSED]
    with pytest.raises(AddressError, match=r"delay = '-1' must be a number from 0 to 3600"):
        open_device(f"replay://{recording.path}?delay=-1", time.clock)


def test_every_loop_and_every_start_is_a_new_epoch(tmp_path: Path) -> None:
    items = [item if isinstance(item, Truth) else dataclasses.replace(item, epoch=7_000_000) for item in recorded(2)]
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    device = ReplayDevice("", Recording(write(tmp_path / "a.mcap", items)), 1.0, True, time.clock, time.wait)
    device.start(sink)
    sink.wait(lambda: len(sink.items) >= 20)
    device.stop()
    assert sink.states[-1] == (DeviceState.CLOSED, "stopped")
    epochs = [frame.epoch for frame in sink.frames]
    assert epochs[:13] == [0] * 6 + [1] * 6 + [2]
    again = RecordingSink()
    device.start(again)
    again.wait(lambda: bool(again.frames))
    device.close()
    assert again.frames[0].epoch > epochs[-1]


def test_a_replay_of_a_corrupt_file_ends_for_good_with_the_reason(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(20))
    device = open_device(f"replay://{path}?speed=100", ManualTime(BEGIN_NS).clock)
    damage(path)
    sink = RecordingSink()
    device.start(sink)
    reason = sink.wait_for(DeviceState.BROKEN)
    device.close()
    assert "a.mcap: the chunk" in reason
    assert "is damaged" in reason
    assert "`abs-service recover`" in reason


def test_the_file_is_read_while_nothing_is_due(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    recording = Recording(write(tmp_path / "a.mcap", recorded(4)))
    device = ReplayDevice("", recording, 1.0, False, time.clock, time.wait)
    read = Recording.frames

    def read_slowly(self: Recording) -> Iterator[Frame | Truth]:
        for item in read(self):
            time.wait(threading.Event(), 0.004)
            yield item

    monkeypatch.setattr(Recording, "frames", read_slowly)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.close()
    late_ms = [(frame.t_arrival_ns - frame.t_host_ns) * 1e-6 for frame in sink.frames]
    assert len(late_ms) == 12
    assert max(late_ms[6:]) < 0.1


def test_what_was_read_before_the_damage_is_delivered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    items = recorded(3)
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    device = ReplayDevice("", Recording(write(tmp_path / "a.mcap", items)), 1.0, False, time.clock, time.wait)

    def read(self: Recording) -> Iterator[Frame | Truth]:
        yield from items
        raise RecordingError("a.mcap: the chunk at byte 1 is damaged")

    monkeypatch.setattr(Recording, "frames", read)
    device.start(sink)
    assert "is damaged" in sink.wait_for(DeviceState.BROKEN)
    device.close()
    assert [item.seq for item in sink.items] == [item.seq for item in items]


def test_malformed_frames_are_counted_and_left_out_of_a_replay(tmp_path: Path) -> None:
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    recording = Recording(write_malformed(tmp_path / "a.mcap", recorded(2)))
    device = ReplayDevice("", recording, 1.0, False, time.clock, time.wait)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.close()
    assert device.counters == {"frames": 6, "unpaired": 0, "malformed": 1}


def test_a_recording_across_a_reboot_of_its_host_keeps_its_pace(tmp_path: Path) -> None:
    frames = [item for item in recorded(6) if isinstance(item, Frame)]
    with (tmp_path / "a.mcap").open("wb") as stream:
        file = McapFile(stream)
        for sensor, camera in CAMERAS.items():
            write_model(file, sensor, camera)
        for number, boot in enumerate(("first", "second")):
            for item in frames:
                wall_ns = WALL_NS + item.t_host_ns + number * 10**9
                shifted = dataclasses.replace(item, t_host_ns=item.t_host_ns + (1 - number) * 10**15, epoch=number)
                mcap_writing.write_frame(file, shifted, Header(rig="demo", seq=item.seq, host_clock=boot), wall_ns)
        file.finish()
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    device = ReplayDevice("", Recording(tmp_path / "a.mcap"), 1.0, False, time.clock, time.wait)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.close()
    once = [item.t_host_ns - BOOT_NS for item in frames]
    assert [item.t_host_ns - BEGIN_NS for item in sink.items] == once + [once[-1] + t_ns for t_ns in once]


def test_a_long_pause_of_a_recording_is_said_while_it_is_waited_for(tmp_path: Path) -> None:
    late = [dataclasses.replace(item, t_host_ns=item.t_host_ns + 3600 * 10**9) for item in recorded(3)[8:]]
    time, sink = ManualTime(BEGIN_NS), RecordingSink()
    recording = Recording(write(tmp_path / "a.mcap", [*recorded(2), *late]))
    device = ReplayDevice("", recording, 2.0, False, time.clock, time.wait)
    device.start(sink)
    sink.wait_for(DeviceState.CLOSED)
    device.close()
    (condition, message), *ends = sink.warnings
    assert message.startswith("nothing was recorded for the next 1800 s of the replay")
    assert ends == [(condition, "")]
    assert sink.items[-1].t_host_ns - sink.items[0].t_host_ns >= 1800 * 10**9


def test_a_relative_path_and_cameras(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "Some file.mcap", recorded(2))
    monkeypatch.chdir(tmp_path)
    device = open_device("replay://Some%20file.mcap?loop=1", ManualTime(BEGIN_NS).clock)
    assert device.cameras["color"].calib_id == CAMERAS["color"].calib_id
    assert device.info.serial == "Some file.mcap"


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("speed=0", r"speed = '0' must be a number from 0\.01 to 100"),
        ("speed=fast", r"speed = 'fast' must be"),
        ("loop=yes", r"loop = 'yes' must be 0 or 1"),
        ("pace=1", r"unknown key 'pace'; allowed are delay, loop, speed"),
    ],
)
def test_invalid_addresses_raise(query: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(f"replay://a.mcap?{query}", ManualTime(BEGIN_NS).clock)


def test_a_sensor_without_a_model_cannot_be_replayed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(2), sensors=("tof",))
    assert Recording(path).cameras.keys() == {"tof"}
    with pytest.raises(AddressError, match=r"topic /color/model .* is missing"):
        open_device(f"replay://{path}", ManualTime(BEGIN_NS).clock)

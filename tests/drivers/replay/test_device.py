"""Real-time playback of recordings."""

import dataclasses
import threading
from pathlib import Path

import pytest

from drivers.contract.device import AddressError, DeviceState, Truth
from drivers.contract.frame import Frame
from drivers.opening import open_device
from drivers.replay import Recording, ReplayDevice
from tests.drivers.replay.recordings import (
    BOOT_NS,
    CAMERAS,
    damage,
    recorded,
    write,
)


class Sink:
    """A sink that sets an event at the end of the replay or after enough frames."""

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

    def on_warning(self, condition: str, message: str) -> None: ...


class Time:
    """A manual clock, advanced by waiting."""

    def __init__(self) -> None:
        self.now_ns = 77_000_000_000

    def clock(self) -> int:
        return self.now_ns

    def wait(self, stop: threading.Event, seconds: float) -> bool:
        self.now_ns += round(seconds * 1e9)
        return stop.is_set()


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_replay_has_real_time_pace_and_current_times(tmp_path: Path, speed: float) -> None:
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
    assert [(s.sensor, s.stream) for s in device.capabilities.streams] == [
        ("tof", "depth"),
        ("tof", "amplitude"),
        ("color", "color"),
    ]
    assert {(s.width, s.height) for s in device.capabilities.streams} == {(32, 24)}


def test_a_replay_can_be_delayed(tmp_path: Path) -> None:
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


def test_every_loop_and_every_start_is_a_new_epoch(tmp_path: Path) -> None:
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


def test_a_replay_of_a_corrupt_file_fails_with_the_reason(tmp_path: Path) -> None:
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
def test_invalid_addresses_raise(query: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(f"replay://a.mcap?{query}", Time().clock)


def test_a_sensor_without_a_model_cannot_be_replayed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", recorded(2), sensors=("tof",))
    assert Recording(path).cameras.keys() == {"tof"}
    with pytest.raises(AddressError, match=r"topic /color/model .* is missing"):
        open_device(f"replay://{path}", Time().clock)

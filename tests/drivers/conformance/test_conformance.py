"""Conformance of every driver to the contract, on its fake and on real hardware; see `bench.py`."""

import math
import threading
from importlib import import_module
from urllib.parse import urlsplit

import pytest

from drivers.contract.controls import ControlInfo, ControlKind, Value
from drivers.contract.device import ControlError, DeviceError, DeviceState
from tests.drivers.conformance.bench import Bench, Open, resources, streaming
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually

STARTS = 50


def test_it_says_who_it_is_and_what_it_delivers_and_delivers_that(opener: Open) -> None:
    device = opener()
    assert device.state == DeviceState.CLOSED
    streams = {stream.key: stream for stream in device.capabilities.streams}
    assert device.info.uri
    assert device.info.model
    assert device.info.serial
    assert len(streams) == len(device.capabilities.streams) > 0
    with streaming(device) as sink:
        assert device.state == DeviceState.STREAMING
        assert sink.receives(4 * len(streams))
        states = [state for state, _ in sink.states]
        assert states == [DeviceState.OPENING, DeviceState.STREAMING]
        assert {frame.key for frame in sink.frames} == set(streams)
        assert device.counters["frames"] >= len(sink.frames) - len(streams)
    for frame in sink.frames:
        stream, camera = streams[frame.key], device.cameras[frame.sensor]
        assert (frame.kind, frame.encoding) == (stream.kind, stream.encoding)
        assert frame.data.shape[:2] == (stream.height, stream.width) == (camera.height, camera.width)
        assert (frame.clock_domain, frame.tick_hz) == (stream.clock.domain, stream.clock.tick_hz)
        assert frame.t_host_ns <= frame.t_arrival_ns
        assert not frame.data.flags.writeable
    for key in streams:
        seqs = [frame.seq for frame in sink.frames if frame.key == key]
        assert seqs == sorted(set(seqs))
    assert sink.states[-1][0] == device.state == DeviceState.CLOSED
    assert all(math.isfinite(value) for value in device.gauges.values())


def test_it_starts_and_stops_fifty_times_and_leaves_nothing_behind(opener: Open) -> None:
    device, sink = opener(), RecordingSink()
    device.start(sink)
    assert sink.receives(1)
    device.stop()
    before, epochs = resources(), {frame.epoch for frame in sink.frames}
    for _ in range(STARTS):
        sink = RecordingSink()
        device.start(sink)
        device.start(RecordingSink())  # already running: nothing happens
        assert sink.receives(1)
        device.stop()
        device.stop()
        count = len(sink.frames)
        assert device.state == DeviceState.CLOSED
        epochs |= (epoch := {frame.epoch for frame in sink.frames})
        assert min(epoch) == max(epochs)
        assert len(sink.frames) == count
    assert eventually(lambda: not resources() - before), resources() - before
    device.close()


def test_opening_and_closing_leaves_nothing_behind(opener: Open) -> None:
    def once() -> None:
        with streaming(opener()):
            pass

    once()
    before = resources()
    for _ in range(5):
        once()
    assert eventually(lambda: not resources() - before), resources() - before


def test_starting_and_stopping_at_once_does_no_harm(opener: Open) -> None:
    device = opener()
    for _ in range(5):
        device.start(RecordingSink())
        device.stop()
    with streaming(device) as sink:
        assert sink.receives(2)


def test_nothing_comes_after_stop_and_a_sink_may_stop_the_device_itself(opener: Open) -> None:
    device = opener()

    class Impatient(RecordingSink):
        def on_frame(self, frame) -> None:
            super().on_frame(frame)
            device.stop()
            device.stop()

    sink = Impatient()
    device.start(sink)
    assert sink.reaches(DeviceState.CLOSED)
    assert len(sink.frames) == 1
    assert not sink.receives(1, 0.3)
    device.close()


def test_a_sink_may_start_the_device_again_itself(opener: Open) -> None:
    device, again = opener(), RecordingSink()

    class Restarting(RecordingSink):
        def on_frame(self, frame) -> None:
            device.stop()
            device.start(again)

    device.start(Restarting())
    assert again.receives(3)
    device.close()
    assert [state for state, _ in again.states] == [DeviceState.OPENING, DeviceState.STREAMING, DeviceState.CLOSED]


def test_it_can_be_closed_while_another_thread_takes_frames(opener: Open) -> None:
    device = opener()
    arrived, go_on = threading.Event(), threading.Event()

    class Slow(RecordingSink):
        def on_frame(self, frame) -> None:
            super().on_frame(frame)
            arrived.set()
            go_on.wait(0.2)

    sink = Slow()
    device.start(sink)
    assert arrived.wait(20)
    closers = [threading.Thread(target=device.close) for _ in range(3)]
    for closer in closers:
        closer.start()
    for closer in closers:
        closer.join(20)
    assert not any(closer.is_alive() for closer in closers)
    count = len(sink.frames)
    go_on.set()
    assert not sink.receives(1, 0.2)
    assert len(sink.frames) == count
    with pytest.raises(DeviceError):
        device.start(RecordingSink())


def test_wrong_controls_are_refused_and_right_ones_taken(opener: Open) -> None:
    device = opener()
    assert device.capabilities.controls == device.controls.infos
    with streaming(device) as sink:
        with pytest.raises(ControlError, match="phase_of_the_moon: the device has no such control"):
            device.controls.set("phase_of_the_moon", 1)
        for info in device.controls.infos:
            before = device.controls.get(info.name)
            for value in _wrong(info):
                with pytest.raises(ControlError, match=f"{info.name} = .*must be {info.allowed}".replace("+", r"\+")):
                    device.controls.set(info.name, value)
            assert device.controls.get(info.name) == before
            device.controls.set(info.name, before)
            assert device.controls.get(info.name) == before
        assert sink.receives(1)


def _wrong(info: ControlInfo) -> list[Value]:
    match info.kind:
        case ControlKind.SWITCH:
            return [2, "on"]
        case ControlKind.CHOICE:
            return ["no such choice", True]
    assert math.isfinite(info.minimum)
    assert math.isfinite(info.maximum)
    return [info.minimum - 1, info.maximum + 1, math.nan, math.inf, "1", True]


def test_what_is_attached_can_be_asked_for_at_any_time(opener: Open) -> None:
    device = opener()
    driver = import_module(f"drivers.{urlsplit(device.info.uri).scheme}")
    with streaming(device) as sink:
        for found in driver.discover(0.3):
            assert found.info.uri.startswith(driver.__name__.rpartition(".")[2])
        assert sink.receives(1)


def test_two_devices_of_one_kind_do_not_disturb_each_other(bench: Bench) -> None:
    one, other = bench.open(), bench.open_second()
    assert one.info.serial != other.info.serial
    assert one.info.uri != other.info.uri
    with streaming(other) as second:
        with streaming(one) as first:
            assert first.receives(2)
            assert second.receives(2)
        assert second.receives(2)

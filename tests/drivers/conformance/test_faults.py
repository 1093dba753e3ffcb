"""Each driver tells what goes wrong with its device, and goes on; see `bench.py`."""

import numpy as np
import pytest

from drivers.contract.device import DeviceState
from drivers.contract.frame import Frame, Kind
from drivers.contract.frame_gate import FrameGate
from tests.drivers.conformance.bench import Bench, Fault, dropped, streaming
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually


def test_lost_data_is_counted_and_never_delivered_torn(bench: Bench) -> None:
    device = bench.open(Fault.DROP)
    sizes = {stream.key: (stream.height, stream.width) for stream in device.capabilities.streams}
    with streaming(device) as sink:
        assert eventually(lambda: dropped(device) > 0)
        assert sink.receives(2)
    assert all(frame.data.shape[:2] == sizes[frame.key] for frame in sink.frames)
    for frame in sink.frames:  # nothing is torn: what is lacking has no return
        assert not frame.incomplete or (frame.kind == Kind.DEPTH and np.isnan(frame.si()).any())


def test_a_device_that_stalls_can_be_stopped_and_started_again(bench: Bench) -> None:
    device = bench.open(Fault.STALL)
    with streaming(device) as sink:
        assert sink.falls_silent()
        assert device.state in {DeviceState.STREAMING, DeviceState.FAILED}
        device.stop()
        assert device.state == DeviceState.CLOSED
        device.stop()


def test_a_device_that_is_unplugged_says_so_and_can_be_closed(bench: Bench) -> None:
    device = bench.open(Fault.UNPLUG)
    with streaming(device) as sink:
        assert sink.reaches(DeviceState.FAILED)
        assert device.state == DeviceState.FAILED
        reason = next(reason for state, reason in sink.states if state == DeviceState.FAILED)
        assert reason
        count = len(sink.frames)
        assert not sink.receives(1, 0.2)
    assert len(sink.frames) == count
    assert device.state == DeviceState.CLOSED


def test_images_of_the_wrong_size_are_counted_and_left_out(bench: Bench) -> None:
    device = bench.open(Fault.WRONG_SIZE)
    sizes = {stream.key: (stream.height, stream.width) for stream in device.capabilities.streams}
    with streaming(device) as sink:
        assert eventually(lambda: dropped(device) > 0)
        assert sink.receives(2)
    assert all(frame.data.shape[:2] == sizes[frame.key] for frame in sink.frames)


def test_an_image_without_any_measurement_is_an_image(bench: Bench) -> None:
    device = bench.open(Fault.NAN)
    empty = []
    with streaming(device) as sink:

        def seen() -> bool:
            empty[:] = [f for f in list(sink.frames) if f.kind == Kind.DEPTH and np.isnan(f.si()).all()]
            return bool(empty)

        assert eventually(seen)
        assert sink.receives(2)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_driver_that_breaks_down_says_so(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks_down(gate: FrameGate, frame: Frame) -> None:
        raise ZeroDivisionError("a mistake of the driver")

    monkeypatch.setattr(FrameGate, "deliver", breaks_down)
    device, sink = bench.open(), RecordingSink()
    try:
        device.start(sink)
        assert sink.reaches(DeviceState.FAILED)
        assert any("a mistake of the driver" in reason for state, reason in sink.states if state == DeviceState.FAILED)
    finally:
        device.close()

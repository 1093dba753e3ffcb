"""The live driver: the real ifm3dpy on loopback, against an emulated processing unit."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from drivers.contract.device import DeviceError, DeviceState, SdkMissingError
from drivers.contract.discovery import Availability
from drivers.o3r import discover, library, open_device
from drivers.o3r.buffers import O3rBuffers
from tests.drivers.o3r.emulated_unit import SERIALS
from tests.drivers.o3r.unit_process import UnitProcess
from tests.drivers.recording_sink import RecordingSink

try:
    ifm3d = library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


@pytest.fixture
def unit() -> Iterator[UnitProcess]:
    with UnitProcess() as running:
        yield running


def points_of_ifm3d(unit: UnitProcess) -> np.ndarray:
    """Coordinates (3, height, width) of the first image as ifm3d computes them for the user [m]."""
    camera = ifm3d.O3R("127.0.0.1", unit.port)
    port = next(one for one in camera.ports() if one.port == "port0")
    grabber, messages = ifm3d.FrameGrabber(camera, port.pcic_port), SimpleQueue[Any]()
    grabber.on_new_frame(messages.put)
    grabber.start([ifm3d.buffer_id.XYZ])
    message = messages.get(timeout=20)
    grabber.stop().wait()
    return np.array(message.get_buffer(ifm3d.buffer_id.XYZ))


def points(camera: Camera, distance: np.ndarray) -> np.ndarray:
    return pose.transform(camera.T_rs, camera.rays() * distance[..., None])


def first_exposure(uri: str) -> tuple[Camera, dict[str, Any]]:
    device, sink = open_device(uri, time.monotonic_ns), RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 4)
    device.close()
    return device.cameras["depth"], {frame.stream: frame for frame in sink.frames[:4]}


def test_a_recorded_frame_arrives_as_it_is_imported(data_set: Callable[[str], Path]) -> None:
    path = data_set("tof_ifm_o3r/O3RBuffer.data")
    imported = {frame.stream: frame for frame in O3rBuffers(path).frames()}
    with UnitProcess(path) as unit:
        camera, live = first_exposure(unit.uri())
        theirs = points_of_ifm3d(unit)
    assert live.keys() == imported.keys()
    for stream, frame in live.items():
        np.testing.assert_array_equal(frame.data, imported[stream].data, err_msg=stream)
        for key in ("encoding", "scale", "geometry", "unit", "invalid", "seq", "t_device_ticks", "tick_hz", "calib_id"):
            assert getattr(frame, key) == getattr(imported[stream], key), key
    assert live["depth"].modulation == "standard_range2m"
    # ifm3d uses the head's other lens model, from pixels to directions; the two differ by up to half a pixel.
    apart = np.linalg.norm(points(camera, live["depth"].si()) - theirs, axis=-1)
    assert 0.0005 < np.nanmedian(apart) < 0.0015
    assert np.nanmax(apart) < 0.007


def test_points_are_those_that_ifm3d_computes_for_the_user(unit: UnitProcess) -> None:
    camera, live = first_exposure(unit.uri())
    theirs, ours = points_of_ifm3d(unit), points(camera, live["depth"].si())
    valid = np.isfinite(ours).all(axis=-1)
    assert valid.sum() == 47
    np.testing.assert_allclose(ours[valid], theirs[valid], atol=1e-6)


def test_every_stream_tells_what_the_head_measured(unit: UnitProcess) -> None:
    device, sink = open_device(unit.uri(), time.monotonic_ns), RecordingSink()
    assert (device.info.model, device.info.serial, device.info.firmware) == ("ifm O3R222", SERIALS[0], "1.4.30")
    may_repeat = {stream.stream for stream in device.capabilities.streams if not stream.noisy}
    assert may_repeat == {"deviation", "confidence"}
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 40)
    device.close()
    depth = sink.of("depth")[0]
    assert (depth.data[5, 7], depth.scale) == (1507 + depth.seq, pytest.approx(0.00025))
    assert (depth.exposure_s, depth.temperature_c) == (pytest.approx(1e-3), 41.5)
    assert sink.of("deviation")[0].data[5, 7] == (1507 + depth.seq) // 50
    assert np.isnan(sink.of("amplitude")[0].si()[0, 0])
    assert sink.of("confidence")[0].data[0, 0] == 1
    assert [frame.seq for frame in sink.of("depth")[:10]] == list(range(1, 11))
    assert device.counters["missing"] == 0


def test_an_image_that_is_left_out_is_counted_in_every_stream(unit: UnitProcess) -> None:
    unit.emulate(fault="drop")
    device, sink = open_device(unit.uri(), time.monotonic_ns), RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.of("depth")) == 8)
    device.close()
    assert [frame.seq for frame in sink.of("depth")] == [1, 2, 3, 4, 6, 8, 10, 12]
    assert device.counters["missing"] in {16, 20}, "in four streams each, of four messages or one more"


def test_a_head_that_counts_anew_begins_an_epoch(unit: UnitProcess) -> None:
    unit.emulate(fault="renumber")
    device, sink = open_device(unit.uri(), time.monotonic_ns), RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.of("depth")) == 7)
    device.close()
    assert [(frame.epoch, frame.seq) for frame in sink.of("depth")][4:7] == [(0, 5), (1, 1), (1, 2)]
    assert device.counters["missing"] == 0


def test_a_head_has_to_be_chosen_to_exist_and_to_run(unit: UnitProcess) -> None:
    both = f"say which one: {unit.uri(SERIALS[0])}, {unit.uri(SERIALS[1])}".replace("?", r"\?")
    with pytest.raises(DeviceError, match=both):
        open_device(f"o3r://127.0.0.1:{unit.port}", time.monotonic_ns)
    with pytest.raises(DeviceError, match="is not attached"):
        open_device(unit.uri("7"), time.monotonic_ns)
    unit.emulate(SERIALS[1], state="CONF")
    with pytest.raises(DeviceError, match="port1 is in state CONF, not RUN; ifm's Vision Assistant"):
        open_device(unit.uri(SERIALS[1]), time.monotonic_ns)


def test_a_unit_that_has_gone_is_named(unit: UnitProcess) -> None:
    device, sink = open_device(unit.uri(), time.monotonic_ns), RecordingSink()
    device.start(sink)
    assert sink.receives(4)
    unit.kill()
    assert "ifm3d says: " in sink.wait_for(DeviceState.FAILED)
    with pytest.raises(DeviceError, match=f"127.0.0.1:{unit.port}"):
        device.start(sink)
    device.close()
    with pytest.raises(DeviceError, match="the processing unit does not answer"):
        open_device(unit.uri(), time.monotonic_ns)


def test_only_the_unit_that_the_environment_names_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("IFM3D_IP", raising=False)
    assert discover(0.3) == []
    monkeypatch.setenv("IFM3D_IP", "127.0.0.1")  # where nothing listens
    (found,) = discover(0.3)
    assert (found.availability, found.remedy) == (Availability.FAULTY, "IFM3D_IP is 127.0.0.1: is the unit there?")

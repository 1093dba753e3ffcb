"""The simulated device: timing, counting of late exposures, and validation of addresses."""

import pytest

from drivers.contract.device import DeviceError
from drivers.contract.frame import Frame
from drivers.opening import available, open_device
from drivers.simulated.address import Address, parse
from drivers.simulated.device import SimulatedDevice
from tests.drivers.manual_time import ManualTime
from tests.drivers.recording_sink import RecordingSink

BEGIN_NS = 5_000_000_000


def run(query: str, time: ManualTime, frames: int) -> tuple[SimulatedDevice, RecordingSink]:
    uri = f"simulated://sheet?{query}"
    address = parse(uri)
    device = SimulatedDevice(uri, address.build(), time.clock, time.wait, address.fault)
    sink = RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= frames, 60)
    device.stop()
    return device, sink


SMALL = "sensors=tof,color&tof=32x24&color=32x24"


def test_exposures_arrive_when_they_are_due() -> None:
    time = ManualTime(BEGIN_NS)
    device, sink = run(SMALL, time, 9)
    assert [frame.seq for frame in sink.frames[:9]] == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    for frame in sink.frames:
        assert frame.t_host_ns == BEGIN_NS + round(frame.seq * 1e9 / 30)
        assert 0 <= frame.t_arrival_ns - frame.t_host_ns < 10
    counters = {**device.counters, "after_stop": 0}  # it may be on the way to the next exposure when it is told to stop
    assert counters == {"frames": len(sink.frames), "late": 0, "lost": 0, "after_stop": 0}
    assert [truth.t_host_ns for truth in sink.truths[:3]] == [frame.t_host_ns for frame in sink.frames[:9:3]]


def test_overdue_exposures_are_delivered_late_with_their_own_timestamps() -> None:
    device, sink = run(SMALL, ManualTime(BEGIN_NS, {1: 110_000_000}), 18)  # 3.3 periods at 30 Hz
    assert [truth.seq for truth in sink.truths][:6] == [0, 1, 2, 3, 4, 5]
    assert [frame.t_host_ns for frame in sink.frames[::3]][:6] == [BEGIN_NS + round(k * 1e9 / 30) for k in range(6)]
    assert [frame.t_arrival_ns - frame.t_host_ns > 30_000_000 for frame in sink.frames[::3]][2:5] == [True, True, False]
    assert device.counters["late"] == 0


def test_overdue_exposures_beyond_the_buffer_are_skipped_and_counted() -> None:
    device, sink = run(SMALL, ManualTime(BEGIN_NS, {1: 210_000_000}), 12)  # 6.3 periods at 30 Hz
    assert [truth.seq for truth in sink.truths][:4] == [0, 1, 7, 8]
    assert device.counters["late"] == 5


def test_a_temporary_fault_loses_the_declared_frames() -> None:
    device, sink = run(f"{SMALL}&fault=drop@2", ManualTime(BEGIN_NS), 12)
    assert [truth.seq for truth in sink.truths][:4] == [0, 1, 3, 5]
    assert device.counters["lost"] >= 3 * 2


def test_addresses_open_by_scheme_and_frames_fit_the_streams() -> None:
    heads = "tof,structured_light,color,bayer,ir,barrier"
    uri = f"simulated://board?seed=2&sensors={heads}&rate=15&color=64x48&tof=32x24"
    device = open_device(uri, ManualTime(BEGIN_NS).clock)
    assert device.info.uri == uri
    assert [f"{s.sensor}/{s.stream}" for s in device.capabilities.streams] == [
        "tof/depth",
        "tof/amplitude",
        "structured_light/depth",
        "color/color",
        "bayer/bayer",
        "ir/ir",
        "barrier/binary",
    ]
    frames, _ = parse(uri).build().expose(0)
    for stream, frame in zip(device.capabilities.streams, frames, strict=True):
        camera = device.cameras[stream.sensor]
        assert (frame.kind, frame.encoding, frame.calib_id) == (stream.kind, stream.encoding, camera.calib_id)
        assert frame.data.shape[:2] == (stream.height, stream.width) == (camera.height, camera.width)
        assert stream.rate_hz == 15


def test_defaults_are_the_demonstration_rig() -> None:
    address = parse("simulated://sheet")
    assert address == Address("sheet", seed=1, sensors=("tof", "color"), rate=30.0)
    cameras = {name: head.camera for name, head in address.build().heads.items()}
    assert (cameras["tof"].width, cameras["tof"].height, cameras["tof"].fx) == (176, 144, 220)
    assert (cameras["color"].width, cameras["color"].height) == (320, 240)
    assert cameras["color"].center[0] == 0.05


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("simulated://sofa", r"scene 'sofa' is none of \['board', 'pair', 'sheet', 'strip', 'target', 'wall'\]"),
        ("simulated://", r"scene '' is none of"),
        ("simulated://sheet?sead=1", r"unknown key 'sead'; allowed are .* seed,"),
        ("simulated://sheet?seed=one", r"seed = 'one' must be a number from 0 to"),
        ("simulated://sheet?seed=1.5", r"seed = '1.5' must be"),
        ("simulated://sheet?seed=-1", r"seed = '-1' must be"),
        ("simulated://sheet?seed=1&seed=2", "seed is given twice"),
        ("simulated://sheet?color=64x48&color=64x48", "color is given twice"),
        ("simulated://sheet?sed=1&rate=-5&tof=0x0&tof=9x9", r"'sed'; .*rate = '-5' must be .*tof = '0x0' must be"),
        ("simulated://sheet?rate=0", r"rate = '0' must be a number from 0.1 to 200"),
        ("simulated://sheet?rate=nan", r"rate = 'nan' must be"),
        ("simulated://sheet?rate=", r"rate = '' must be"),
        ("simulated://sheet?sensors=tof,lidar", r"sensors = 'tof,lidar' must be one or more of \['barrier', 'bayer'"),
        ("simulated://sheet?sensors=", r"sensors = '' must be"),
        ("simulated://sheet?sensors=tof,tof", "each once"),
        ("simulated://sheet?occluder=cat", r"occluder = 'cat' must be one of none, hand"),
        (
            "simulated://sheet?fault=stall",
            r"fault = 'stall' must be FAULT@EXPOSURE, for example stall@20; .* nan, stall",
        ),
        ("simulated://sheet?fault=fire@3", r"fault = 'fire@3' must be FAULT@EXPOSURE"),
        ("simulated://sheet?lens=round", r"lens = 'round' must be 1 to 8 numbers from -1 to 1 with commas"),
        ("simulated://sheet?lens=0,0,0,0,0,0,0,0,0", "lens = .* must be 1 to 8 numbers"),
        ("simulated://sheet?lens=", "lens = '' must be 1 to 8 numbers"),
        ("simulated://sheet?lens_model=fish", r"lens_model = 'fish' must be one of brown_conrady, fisheye"),
        ("simulated://sheet?lens_model=fisheye&lens=0,0,0,0,1", "lens_model = fisheye: a lens has at most 4 finite"),
        ("simulated://sheet?lens=-0.9", r"lens = \(-0.9,\) is too strong: .* has no inverse"),
        ("simulated://sheet?order=rgb", r"order = 'rgb' must be one of "),
        ("simulated://strip?bend=30", r"bend means nothing in 'strip', only in \['board', 'pair', 'sheet'\]"),
        ("simulated://sheet?weight=0.1", r"weight means nothing in 'sheet', only in \['strip'\]"),
        ("simulated://strip?stiffness=0", r"stiffness = '0' must be a number from 0.0005 to 10"),
        ("simulated://strip?turn=3", r"turn means nothing in 'strip', only in"),
        ("simulated://sheet?leave=5,3", r"leave = '5,3' must be two numbers from 0 to 3600 .* the second greater"),
        ("simulated://sheet?leave=5", r"leave = '5' must be two numbers"),
        ("simulated://board?texture=fine", r"texture means nothing in 'board', only in \['pair', 'sheet'\]"),
        ("simulated://sheet?barrier=64x48", "unknown key 'barrier'"),
        ("simulated://sheet?color=640", r"color = '640' must be WIDTHxHEIGHT"),
        ("simulated://sheet?color=8x8", r"color = '8x8' must be WIDTHxHEIGHT, each from 16 to 2048"),
        ("laser://x", r"scheme 'laser' is none of \[.*'simulated'"),
        ("codec://x", r"scheme 'codec' is none of"),
        ("opening://x", r"scheme 'opening' is none of"),
        ("sheet", r"scheme '' is none of"),
    ],
)
def test_errors_name_key_value_and_what_is_allowed(uri: str, complaint: str) -> None:
    with pytest.raises(DeviceError, match=complaint):
        open_device(uri, ManualTime(BEGIN_NS).clock)


def test_every_available_driver_has_an_open_device() -> None:
    assert "simulated" in available()
    assert not {"codec", "frame", "device", "opening"} & set(available())


def first(exposure_s: float) -> dict[str, Frame]:
    time = ManualTime(BEGIN_NS)
    device = SimulatedDevice(
        "simulated://sheet", parse(f"simulated://sheet?{SMALL}&noise=0").build(), time.clock, time.wait
    )
    device.controls.set("exposure_s", exposure_s)
    sink = RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 3, 60)
    device.stop()
    return {frame.stream: frame for frame in sink.frames[:3]}


def test_colours_follow_the_exposure_time_and_distances_do_not() -> None:
    typical, short = first(0.01), first(0.005)
    assert abs(short["color"].data.astype(float) - 0.5 * typical["color"].data.astype(float)).max() <= 1
    assert (short["depth"].data == typical["depth"].data).all()
    assert (typical["color"].exposure_s, short["color"].exposure_s) == (0.01, 0.005)


@pytest.mark.parametrize(("sensors", "names"), [("tof,bayer", ["exposure_s"]), ("tof,structured_light", [])])
def test_only_heads_with_colours_have_an_exposure_time(sensors: str, names: list[str]) -> None:
    device = open_device(f"simulated://sheet?sensors={sensors}", lambda: 0)
    assert [info.name for info in device.capabilities.controls] == names
    device.close()

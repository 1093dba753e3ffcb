"""The remote device: unchanged frames, clock mapping, and counted losses."""

import time
from dataclasses import replace

import pytest
from absmsg.v1.common_pb2 import Header

from abs_service.bus import keys
from drivers.contract.capabilities import StreamInfo
from drivers.contract.device import AddressError, DeviceError, DeviceState, FinalError
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.opening import open_device
from drivers.remote.address import Address, parse
from drivers.remote.device import RemoteDevice
from drivers.remote.link import open_link
from drivers.remote.probe import RemoteRig
from tests.drivers.conformance.benches.remote import bench
from tests.drivers.recording_sink import RecordingSink
from tests.drivers.replay.recordings import CAMERAS, SIMULATION

FRAMES = [frame for frame in SIMULATION.frames(0) if frame.sensor == "tof"]
STREAMS = tuple(StreamInfo("tof", f.stream, f.kind, f.encoding, 32, 24, 30.0) for f in FRAMES)
#: How far the clock of the other host is ahead, and its drift.
AHEAD_NS, DRIFT = 7_000_000_000_000, 80e-6


class Wire:
    """A fake link with messages from the test."""

    def __init__(self) -> None:
        self.listeners = {}
        self.on_gone = lambda: None

    def subscribe(self, rig, pattern, on_message):
        self.listeners[pattern] = on_message

    def watch_liveliness(self, rig, on_gone):
        self.on_gone = on_gone

    def unsubscribe(self):
        self.listeners = {}

    close = unsubscribe

    def say(self, frame: Frame) -> None:
        topic = keys.image(frame.sensor, frame.stream)
        image, info = codec.encode_image(frame, 0), codec.encode_info(frame, Header(t_host_ns=frame.t_host_ns))
        self.listeners["*/*/image"](topic, image, info)


@pytest.fixture
def connected():
    """Starts a device on a fake link with a manual clock."""

    def connected(same_clock: bool):
        wire, sink, now = Wire(), RecordingSink(), [5_000_000_000]
        cameras = {"tof": CAMERAS["tof"]}
        remote = RemoteRig(cameras, STREAMS, same_clock)
        device = RemoteDevice("remote://a:1/bench", "bench", wire, remote, lambda: now[0])  # type: ignore[arg-type]
        device.start(sink)
        return device, wire, sink, now

    return connected


def frame(seq: int, t_host_ns: int, t_arrival_ns: int = 0, epoch: int = 900, which: int = 0) -> Frame:
    arrival_ns = t_arrival_ns or t_host_ns + 1_000_000
    return replace(FRAMES[which], seq=seq, epoch=epoch, t_host_ns=t_host_ns, t_arrival_ns=arrival_ns)


def test_with_a_shared_clock_only_the_epoch_of_a_frame_changes(connected) -> None:
    device, wire, sink, _ = connected(same_clock=True)
    sent = frame(41, 1_234_567_891, t_arrival_ns=1_240_000_000)
    wire.say(sent)
    (got,) = sink.frames
    for name in ("seq", "t_host_ns", "t_arrival_ns", "t_device_ticks", "tick_hz", "clock_domain", "calib_id", "scale"):
        assert getattr(got, name) == getattr(sent, name), name
    assert (got.data == sent.data).all()
    assert got.epoch == 0
    assert device.gauges == {}


def test_host_times_of_another_host_are_mapped(connected) -> None:
    device, wire, sink, now = connected(same_clock=False)
    for k in range(600):
        exposure_ns = 5_000_000_000 + k * 33_333_333
        theirs_ns = round(exposure_ns * (1 - DRIFT)) + AHEAD_NS
        now[0] = exposure_ns + 4_000_000 + (k * 7919 % 10) * 1_000_000  # 4 ms there, up to 9 ms of network
        wire.say(frame(k, theirs_ns, theirs_ns + 4_000_000))
    error_ns = sink.frames[-1].t_host_ns - (5_000_000_000 + 599 * 33_333_333)
    assert abs(error_ns) < 500_000
    assert device.gauges["clock.tof/depth.drift_ppm"] == pytest.approx(80, abs=10)
    assert {f.epoch for f in sink.frames} == {0}
    assert all(f.t_host_ns <= f.t_arrival_ns for f in sink.frames)
    assert sink.frames[-1].t_sigma_ns > 0


def test_a_reboot_of_the_other_host_is_a_new_epoch(connected) -> None:
    _, wire, sink, now = connected(same_clock=False)
    for k in range(60):
        now[0] += 33_333_333
        wire.say(frame(k, now[0] + (AHEAD_NS if k < 30 else 0)))
    assert {f.epoch for f in sink.frames} == {0, 1}
    assert abs(sink.frames[-1].t_host_ns - now[0]) < 10_000_000


def test_missing_and_malformed_frames_are_counted(connected) -> None:
    device, wire, sink, _ = connected(same_clock=True)
    for seq in (1, 2, 5, 6):
        wire.say(frame(seq, seq * 10**7))
    wire.listeners["*/*/image"]("tof/depth/image", b"\xff", b"\xff")
    assert (device.counters["missing"], device.counters["malformed"]) == (2, 1)
    assert [f.seq for f in sink.frames] == [1, 2, 5, 6]


def test_each_remote_epoch_is_one_epoch_without_losses(connected) -> None:
    device, wire, sink, _ = connected(same_clock=True)
    for epoch in (900, 950):
        for seq in (7, 8):
            for which in (0, 1):
                wire.say(frame(seq, epoch * 10**9 + seq * 10**7, epoch=epoch, which=which))
    assert [f.epoch for f in sink.frames] == [0, 0, 0, 0, 1, 1, 1, 1]
    assert device.counters["missing"] == 0


def test_the_end_of_the_remote_process_is_a_failure(connected) -> None:
    device, wire, sink, _ = connected(same_clock=True)
    wire.on_gone()
    assert device.state == DeviceState.FAILED
    assert sink.states[-1] == (DeviceState.FAILED, 'the capture of rig "bench" has ended')


def test_an_address_names_host_rig_and_options() -> None:
    assert parse("remote://") == Address()
    address = parse("remote://192.168.1.7:7448/bench?protocol=udp&learn=2&shared_memory=0&sensors=a,b")
    assert address == Address("192.168.1.7", 7448, "bench", "udp", False, 2.0, ("a", "b"))
    assert address.endpoint == "udp/192.168.1.7:7448"
    assert parse(address.uri("bench")) == address
    assert parse("remote://[fe80::1]/a").endpoint == "tcp/[fe80::1]:7447"


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("remote://a:70000/x", "the port must be a number from 1 to 65535"),
        ("remote://a/x/y", "'x/y' is no name of a rig; write remote://HOST:PORT/RIG"),
        ("remote://a/x?speed=1", "unknown key 'speed'; allowed are"),
        ("remote://a/x?learn=0", r"learn = '0' must be a number from 0\.1 to 60"),
        ("remote://a/x?protocol=http", "protocol = 'http' must be one of tcp, tls"),
        ("remote://a/x?sensors=tof,", "sensors = 'tof,' must be names of sensors with commas in between"),
        ("remote://a/x?shared_memory=yes", "shared_memory = 'yes' must be 0 or 1"),
    ],
)
def test_invalid_addresses_raise(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(uri, time.monotonic_ns)


def test_an_unreachable_endpoint_raises_with_the_remedy(endpoint: str) -> None:
    where = endpoint.removeprefix("tcp/")
    with pytest.raises(DeviceError, match=f"nothing answers at tcp/{where} within .* is `abs-service run` running"):
        open_link(parse(f"remote://{where}/x"), timeout_s=0.2)


def test_a_host_without_an_address_raises_with_its_name() -> None:
    with pytest.raises(DeviceError, match=r'the name "no-such-host\.invalid" cannot be resolved'):
        open_link(parse("remote://no-such-host.invalid:7447/x"), timeout_s=0.2)


def test_an_unknown_rig_raises_with_the_existing_ones() -> None:
    with bench() as rigs:
        with pytest.raises(
            DeviceError, match=r"remote://none is not attached; attached: remote://.*/bench.*, .*/other"
        ):
            open_device(f"remote://127.0.0.1:{rigs.port}/none", time.monotonic_ns)
        with pytest.raises(DeviceError, match="2 remote devices are attached; say which one"):
            open_device(f"remote://127.0.0.1:{rigs.port}", time.monotonic_ns)


def test_missing_sensors_raise_instead_of_being_omitted() -> None:
    with bench() as rigs:
        uri = f"remote://127.0.0.1:{rigs.port}/bench?learn=0.3&sensors=tof,color"
        with pytest.raises(DeviceError, match='rig "bench" has not announced color yet; announced: tof') as caught:
            open_device(uri, time.monotonic_ns)
        assert not isinstance(caught.value, FinalError)


def test_processes_of_one_host_share_a_clock() -> None:
    with bench() as rigs:
        device = rigs.open()
        sink = RecordingSink()
        device.start(sink)
        assert sink.receives(10)
        assert device.gauges == {}, "no clock is mapped"
        assert [stream.rate_hz for stream in device.capabilities.streams] == pytest.approx([60, 60], rel=0.4)
        device.close()

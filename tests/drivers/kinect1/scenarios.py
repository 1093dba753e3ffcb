"""Scenarios on unmodified libusb under umockdev, one function each, run by name.

umockdev-run … -- python -m tests.drivers.kinect1.scenarios NAME
"""

import os
import sys
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from drivers.contract.device import Device, DeviceError, DeviceState
from drivers.contract.discovery import Availability
from drivers.contract.frame import Frame
from drivers.kinect1 import discover, open_device, unpacking
from drivers.kinect1.reference_plane import ReferencePlane
from evaluation.service.kinect1_emulation.emulated_camera import noise
from evaluation.service.kinect1_emulation.testbed import SERIALS, Server
from tests.drivers.conformance.bench import resources
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually

TABLE = ReferencePlane().table()


def streams() -> None:
    """Depth and colour are bit-exact and complete, and no resources leak."""
    with Server("--patient"):
        held: list[Counter[str]] = []
        for _ in range(4):
            device = open_device("kinect1://", time.monotonic_ns)
            sink = watch(device, each=8)
            device.controls.set("exposure_s", 0.01)
            assert device.controls.get("exposure_s") == pytest.approx(0.01, abs=1e-4)
            device.close()
            assert [state for state, _ in sink.states] == ["opening", "streaming", "closed"]
            compare(sink.frames)
            for stream in ("depth", "bayer"):
                seqs = [frame.seq for frame in sink.of(stream)]
                assert seqs == list(range(len(seqs)))
            held.append(resources())
        assert not held[-1] - held[0], held[-1] - held[0]


def infrared() -> None:
    """Infra-red images on the colour endpoint."""
    with Server("--patient"):
        device = open_device(f"kinect1://{SERIALS[0]}?streams=ir", time.monotonic_ns)
        sink = RecordingSink()
        device.start(sink)
        sink.wait(lambda: len(sink.frames) >= 3)
        device.close()
        stream = noise().packet_streams["ir"]
        for frame in sink.frames:
            shown = np.frombuffer(stream.shown(frame.t_device_ticks // 2_000_000), np.uint8)
            np.testing.assert_array_equal(frame.data, unpacking.infrared(shown, 488, 640))


def loss() -> None:
    """Packet loss of 1 %: most colour images are dropped and counted; depth images lack the pixels that were lost."""
    with Server("--patient") as server:
        device = open_device("kinect1://", time.monotonic_ns)
        sink = RecordingSink()
        server.send("lose 0 0.01")
        device.start(sink)
        sink.wait(lambda: min(len(sink.of("depth")), len(sink.of("bayer"))) >= 4)
        device.stop()
        compare(sink.frames)
        counters = device.counters
        last = {stream: sink.of(stream)[-1].seq for stream in ("depth", "bayer")}
        missing = sum(seq + 1 - len(sink.of(stream)) for stream, seq in last.items())
        lacking = sum(frame.incomplete for frame in sink.of("depth"))
        print(f"{len(sink.of('depth'))} of {last['depth'] + 1} depth images, {lacking} of them incomplete")
        assert lacking > 0.5 * len(sink.of("depth"))
        assert not any(frame.incomplete for frame in sink.of("bayer"))
        assert 0 < missing <= counters["lost_packets"] <= missing + 150
        assert counters["bad_header"] == counters["wrong_size"] == counters["resynchronised"] == 0
        gauges = device.gauges
        assert gauges["depth.missing_packets"] > 0.005 * 242 * last["depth"]
        server.send("lose 0 0")
        again = watch(device, each=8)
        compare(again.frames)
        device.close()


def disturbance() -> None:
    """Packets that the host reports as damaged are not used, whatever they hold: their images are dropped."""
    with Server("--patient") as server:
        device = open_device("kinect1://?streams=color", time.monotonic_ns)
        sink = RecordingSink()
        device.start(sink)
        sink.wait(lambda: len(sink.frames) >= 3)
        server.send("disturb 0")
        assert eventually(lambda: device.counters["lost_packets"] >= 20)
        device.close()
        compare(sink.frames)
        assert device.gauges["bayer.missing_packets"] >= 20


def unplugging() -> None:
    """An unplugged device fails with a reason; plugged in again it is found and opened by its serial number."""
    with Server("--patient") as server:
        device = open_device("kinect1://", time.monotonic_ns)
        sink = watch(device, each=2)
        server.send("unplug 0")
        assert "unplugged" in sink.wait_for(DeviceState.FAILED)
        device.close()
        assert discover(1.0) == []
        with pytest.raises(DeviceError, match="not attached"):
            open_device(f"kinect1://{SERIALS[0]}", time.monotonic_ns)
        server.send("plug 0")
        assert [found.info.serial for found in discover(1.0)] == [SERIALS[0]]
        device = open_device(f"kinect1://{SERIALS[0]}", time.monotonic_ns)
        compare(watch(device, each=2).frames)
        device.close()


def kernel_driver() -> None:
    """The kernel's webcam driver is detached; if that fails, the message names the remedy."""
    with Server("--patient") as server:
        server.send("driver 0 gspca_kinect")
        assert discover(1.0)[0].availability == Availability.READY
        device = open_device("kinect1://", time.monotonic_ns)
        compare(watch(device, each=2).frames)
        device.close()
        server.send("driver 0 stubborn")
        with pytest.raises(DeviceError, match="modprobe -r gspca_kinect"):
            open_device("kinect1://", time.monotonic_ns)


def permission() -> None:
    """Missing permission: the message says how to install the udev rules."""
    with Server("--patient") as server, nobody(server.root):
        (found,) = discover(1.0)
        assert found.availability == Availability.NO_PERMISSION, found
        assert found.info.serial == SERIALS[0]
        assert "/etc/udev/rules.d/60-abs-service.rules" in found.remedy
        with pytest.raises(DeviceError, match="abs-service devices --udev"):
            open_device("kinect1://", time.monotonic_ns)


def in_use() -> None:
    """A second open fails with the reason; the first user is not affected."""
    with Server("--patient"):
        device = open_device("kinect1://", time.monotonic_ns)
        sink = watch(device, each=2)
        assert discover(1.0)[0].availability == Availability.BUSY
        with pytest.raises(DeviceError, match="another program"):
            open_device("kinect1://", time.monotonic_ns)
        count = len(sink.frames)
        sink.wait(lambda: len(sink.frames) > count + 2)
        device.close()


def two() -> None:
    """Two cameras in one process with separate images; unplugging one does not affect the other."""
    with Server("--patient", "--cameras", "2") as server:
        assert {found.info.serial for found in discover(1.0)} == set(SERIALS)
        devices = [open_device(f"kinect1://{serial}", time.monotonic_ns) for serial in SERIALS]
        sinks = [watch(device, each=3) for device in devices]
        server.send("unplug 0")
        sinks[0].wait_for(DeviceState.FAILED)
        devices[0].close()
        count = len(sinks[1].frames)
        sinks[1].wait(lambda: len(sinks[1].frames) > count + 4)
        devices[1].close()
        for seed, sink in enumerate(sinks, start=1):
            compare(sink.frames, seed)


def watch(device: Device, each: int) -> RecordingSink:
    """A sink that has received so many images of depth and colour each."""
    sink = RecordingSink()
    device.start(sink)
    sink.wait(lambda: min(len(sink.of("depth")), len(sink.of("bayer"))) >= each, 60)
    return sink


def compare(frames: list[Frame], seed: int = 1) -> None:
    """Asserts that frames are bit-exact copies of the emulated images at their time, but for lost pixels of depth."""
    assert frames
    packet_streams = noise(seed=seed).packet_streams
    for frame in frames:
        number = frame.t_device_ticks // 2_000_000
        if frame.stream == "depth":
            shown = np.frombuffer(packet_streams["depth"].shown(number), np.uint8)
            expected = unpacking.depth(shown, TABLE, 480, 640)
            lost = frame.data == 0 if frame.incomplete else np.zeros(frame.data.shape, bool)
            np.testing.assert_array_equal(frame.data[~lost], expected[~lost])
        else:
            assert frame.data.tobytes() == packet_streams["color"].shown(number)


@contextmanager
def nobody(root: Path):
    """Switches to a user without permission to open the camera."""
    discover(1.0)  # imports modules that this user may not be able to read
    (root / "dev/bus/usb/001/002").chmod(0)
    if os.geteuid() != 0:
        yield
        return
    root.chmod(0o755)
    (root / "ioctl/dev/bus/usb/001/002").chmod(0o777)  # umockdev connects before it tries to open the file
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


STORIES = {
    story.__name__: story
    for story in (streams, infrared, loss, disturbance, unplugging, kernel_driver, permission, in_use, two)
}

if __name__ == "__main__":
    STORIES[sys.argv[1]]()

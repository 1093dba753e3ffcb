"""What may happen to a camera, on unmodified libusb: each function is one story, run under umockdev by its name.

umockdev-run … -- python -m tests.drivers.kinect1.scenarios NAME
"""

import os
import re
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
from tests.drivers.conformance import eventually, resources
from tests.drivers.kinect1.emulator import noise
from tests.drivers.kinect1.listener import Listener
from tests.drivers.kinect1.testbed import SERIALS, Server

TABLE = ReferencePlane().table()


def streams() -> None:
    """Depth and colour arrive bit for bit as they were shown, none is missing, and nothing is left behind."""
    with Server("--patient"):
        held: list[Counter[str]] = []
        for _ in range(4):
            device = open_device("kinect1://", time.monotonic_ns)
            listener = watch(device, each=8)
            device.controls.set("exposure_s", 0.01)
            assert device.controls.get("exposure_s") == pytest.approx(0.01, abs=1e-4)
            device.close()
            assert [state for state, _ in listener.states] == ["opening", "streaming", "closed"]
            compare(listener.frames)
            for stream in ("depth", "bayer"):
                seqs = [frame.seq for frame in listener.of(stream)]
                assert seqs == list(range(len(seqs)))
            held.append(resources())
        assert not held[-1] - held[0], held[-1] - held[0]


def infrared() -> None:
    """The other use of the colour pipe."""
    with Server("--patient"):
        device = open_device(f"kinect1://{SERIALS[0]}?streams=ir", time.monotonic_ns)
        listener = Listener()
        device.start(listener)
        listener.wait(lambda: len(listener.frames) >= 3)
        device.close()
        film = noise().films["ir"]
        for frame in listener.frames:
            shown = np.frombuffer(film.shown(frame.t_device_ticks // 2_000_000), np.uint8)
            np.testing.assert_array_equal(frame.data, unpacking.infrared(shown, 488, 640))


def loss() -> None:
    """With one packet in a hundred lost most images are dropped and counted; only whole ones arrive."""
    with Server("--patient") as server:
        device = open_device("kinect1://", time.monotonic_ns)
        listener = Listener()
        server.tell("lose 0 0.01")
        device.start(listener)
        listener.wait(lambda: min(len(listener.of("depth")), len(listener.of("bayer"))) >= 4)
        device.stop()
        compare(listener.frames)
        counters = device.counters
        last = {stream: listener.of(stream)[-1].seq for stream in ("depth", "bayer")}
        missing = sum(seq + 1 - len(listener.of(stream)) for stream, seq in last.items())
        assert 0 < missing <= counters["lost_packets"] <= missing + 150
        assert counters["bad_header"] == counters["wrong_size"] == counters["resynchronised"] == 0
        gauges = device.gauges
        assert gauges["depth.missing_packets"] > 0.005 * 242 * last["depth"]
        server.tell("lose 0 0")
        again = watch(device, each=8)
        compare(again.frames)
        device.close()


def disturbance() -> None:
    """Packets that the host reports as damaged are not used, whatever they hold: their images are dropped."""
    with Server("--patient") as server:
        device = open_device("kinect1://?streams=color", time.monotonic_ns)
        listener = Listener()
        device.start(listener)
        listener.wait(lambda: len(listener.frames) >= 3)
        server.tell("disturb 0")
        assert eventually(lambda: device.counters["lost_packets"] >= 20)
        device.close()
        compare(listener.frames)
        assert device.gauges["bayer.missing_packets"] >= 20


def unplugging() -> None:
    """The device fails and says why; plugged in again it is found and opened, by the same number."""
    with Server("--patient") as server:
        device = open_device("kinect1://", time.monotonic_ns)
        listener = watch(device, each=2)
        server.tell("unplug 0")
        assert "unplugged" in listener.wait_for(DeviceState.FAILED)
        device.close()
        assert discover(1.0) == []
        with pytest.raises(DeviceError, match="not attached"):
            open_device(f"kinect1://{SERIALS[0]}", time.monotonic_ns)
        server.tell("plug 0")
        assert [found.info.serial for found in discover(1.0)] == [SERIALS[0]]
        device = open_device(f"kinect1://{SERIALS[0]}", time.monotonic_ns)
        compare(watch(device, each=2).frames)
        device.close()


def kernel_driver() -> None:
    """The kernel's webcam driver gives way; where it must not, the message says how to send it away."""
    with Server("--patient") as server:
        server.tell("driver 0 gspca_kinect")
        assert discover(1.0)[0].availability == Availability.READY
        device = open_device("kinect1://", time.monotonic_ns)
        compare(watch(device, each=2).frames)
        device.close()
        server.tell("driver 0 stubborn")
        with pytest.raises(DeviceError, match="modprobe -r gspca_kinect"):
            open_device("kinect1://", time.monotonic_ns)


def permission() -> None:
    """Whoever may not open the camera is told the rule that allows it, and where it belongs."""
    with Server("--patient") as server, nobody(server.root):
        (found,) = discover(1.0)
        assert found.availability == Availability.NO_PERMISSION, found
        assert found.info.serial == SERIALS[0]
        assert "/etc/udev/rules.d/60-abs-service.rules" in found.remedy
        with pytest.raises(DeviceError, match=re.escape('ATTR{idProduct}=="02ae"')):
            open_device("kinect1://", time.monotonic_ns)


def in_use() -> None:
    """Who comes second is told so, and the first does not notice."""
    with Server("--patient"):
        device = open_device("kinect1://", time.monotonic_ns)
        listener = watch(device, each=2)
        assert discover(1.0)[0].availability == Availability.BUSY
        with pytest.raises(DeviceError, match="another program"):
            open_device("kinect1://", time.monotonic_ns)
        count = len(listener.frames)
        listener.wait(lambda: len(listener.frames) > count + 2)
        device.close()


def two() -> None:
    """Two cameras in one program, each with its own images; one may go while the other stays."""
    with Server("--patient", "--cameras", "2") as server:
        assert {found.info.serial for found in discover(1.0)} == set(SERIALS)
        devices = [open_device(f"kinect1://{serial}", time.monotonic_ns) for serial in SERIALS]
        listeners = [watch(device, each=3) for device in devices]
        server.tell("unplug 0")
        listeners[0].wait_for(DeviceState.FAILED)
        devices[0].close()
        count = len(listeners[1].frames)
        listeners[1].wait(lambda: len(listeners[1].frames) > count + 4)
        devices[1].close()
        for seed, listener in enumerate(listeners, start=1):
            compare(listener.frames, seed)


def watch(device: Device, each: int) -> Listener:
    """A listener that has heard so many images of depth and colour each."""
    listener = Listener()
    device.start(listener)
    listener.wait(lambda: min(len(listener.of("depth")), len(listener.of("bayer"))) >= each, 60)
    return listener


def compare(frames: list[Frame], seed: int = 1) -> None:
    """Asserts that frames are what the emulator showed at their time, bit for bit."""
    assert frames
    films = noise(seed=seed).films
    for frame in frames:
        number = frame.t_device_ticks // 2_000_000
        if frame.stream == "depth":
            shown = np.frombuffer(films["depth"].shown(number), np.uint8)
            np.testing.assert_array_equal(frame.data, unpacking.depth(shown, TABLE, 480, 640))
        else:
            assert frame.data.tobytes() == films["color"].shown(number)


@contextmanager
def nobody(root: Path):
    """Becomes a user who may see the testbed but not open the camera."""
    discover(1.0)  # imports what that user might not even be allowed to read
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

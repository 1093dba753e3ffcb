"""A device that does what a test says."""

import threading

import numpy as np

from calib import pose
from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls
from drivers.contract.device import DeviceInfo, DeviceState
from drivers.contract.frame import Frame, Kind

CAMERA = Camera(4, 3, 5.0, 5.0, 1.5, 1.0, T_rs=pose.from_rotation_vector([0.1, 0.2, 0.3], [0.05, 0, 0.01]))

#: Limits of the exposure time of a device that can be adjusted.
EXPOSURE = ControlInfo("exposure_s", ControlKind.NUMBER, "s", 0.001, 0.033)


class FakeDevice:
    """Device that follows a script."""

    capabilities = Capabilities((StreamInfo("head", "image", Kind.COLOR, "mono8", 4, 3, 30.0),))
    controls = Controls()
    gauges: dict[str, float] = {}  # noqa: RUF012
    state = DeviceState.CLOSED

    def __init__(self, heads=("head", "other"), start=lambda sink: None, serial="1"):
        self.info = DeviceInfo(f"fake://{serial}", "fake", serial)
        self.cameras = dict.fromkeys(heads, CAMERA)
        self.counters = {"frames": 1}
        self.start = start
        self.closed = threading.Event()

    def stop(self):
        pass

    def close(self):
        self.closed.set()


def frame(sensor="head", seq=0):
    """An image of a head."""
    return Frame(sensor, "image", Kind.COLOR, np.zeros((3, 4), np.uint8), "mono8", 1, 1, seq)


def failing(reason):
    """Makes a device that fails after its first frame."""

    def start(sink):
        sink.on_state(DeviceState.STREAMING, "")
        sink.on_frame(frame())
        sink.on_state(DeviceState.FAILED, reason)

    return lambda: FakeDevice(start=start)


def working():
    """A device with one frame."""
    return FakeDevice(start=lambda sink: (sink.on_state(DeviceState.STREAMING, ""), sink.on_frame(frame())))


def adjustable():
    """A device with a frame, and with a control of every kind: an exposure time ends the automatic one."""
    values = {"auto_exposure": True, "exposure_s": 0.01, "infrared_gain": 12, "sync_role": "free"}

    def control(info):
        def write(value):
            values[info.name] = value
            if info is EXPOSURE:
                values["auto_exposure"] = False

        return Control(info, lambda: values[info.name], write)

    device = working()
    device.controls = Controls(
        control(info)
        for info in (
            EXPOSURE,
            ControlInfo("auto_exposure", ControlKind.SWITCH),
            ControlInfo("infrared_gain", ControlKind.WHOLE, minimum=1, maximum=50),
            ControlInfo("sync_role", ControlKind.CHOICE, choices=("free", "master")),
        )
    )
    return device

"""Server process of a testbed: emulated cameras on umockdev's sockets.

Prints "ready", then answers one command per line:

  unplug N, plug N     detaches and attaches a camera
  driver N NAME        a kernel driver claims the camera; "driver N stubborn" one that cannot be detached
  disturb N            the host reports errors for some packets of a camera from now on
  lose N SHARE         loses this fraction of a camera's packets from now on
  play NS RATE         plays the sequences once, from a time of CLOCK_MONOTONIC on, at a frame rate
  cpu                  CPU time of the server [s]
  late N               number of images of a camera without a pending transfer
"""

import argparse
import contextlib
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from evaluation.service.kinect1_emulation.emulated_camera import FORMS, EmulatedKinect, noise
from evaluation.service.kinect1_emulation.packet_stream import RATE_HZ, PacketStream
from evaluation.service.kinect1_emulation.testbed import NAMES, NUMBERS, SERIALS
from evaluation.service.kinect1_emulation.umockdev import Program
from evaluation.service.kinect1_emulation.usbfs import BEGIN_S, Connection, Socketed


class Bus:
    """The cameras of a testbed.

    Args:
        root: umockdev's folder.
        kinects: attached cameras.
        patient: see `Connection`.
    """

    def __init__(self, root: Path, kinects: list[EmulatedKinect], patient: bool) -> None:
        self._root = root
        self.devices = [Socketed(kinect, serial) for kinect, serial in zip(kinects, SERIALS)]
        for number, device in zip(NUMBERS, self.devices):
            path = root / "ioctl" / "dev" / "bus" / "usb" / "001" / number
            path.parent.mkdir(parents=True, exist_ok=True)
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(str(path))
            listener.listen()
            threading.Thread(target=self._accept, args=(listener, device, patient), daemon=True).start()

    def plug(self, index: int, plugged: bool) -> None:
        """Attaches or detaches a camera."""
        entry = self._root / "sys" / "bus" / "usb" / "devices" / NAMES[index]
        aside = self._root / f"unplugged-{index}"
        (entry if not plugged else aside).rename(aside if not plugged else entry)
        self.devices[index].plugged = plugged

    def hold(self, index: int, driver: str) -> None:
        """Lets a kernel driver claim a camera."""
        self.devices[index].driver = "gspca_kinect"
        self.devices[index].stubborn = driver == "stubborn"

    def lose(self, index: int, share: float) -> None:
        """Loses packets of a camera from now on."""
        for stream in self.devices[index].kinect.packet_streams.values():
            stream.lose(share)

    def play(self, begin_ns: int, rate_hz: int) -> None:
        """Plays the sequences of all cameras once."""
        for device in self.devices:
            for stream in device.kinect.packet_streams.values():
                stream.play(round((begin_ns * 1e-9 - BEGIN_S) * RATE_HZ), RATE_HZ // rate_hz)

    @staticmethod
    def _accept(listener: socket.socket, device: Socketed, patient: bool) -> None:
        while True:
            stream, _ = listener.accept()
            threading.Thread(target=Connection(Program(stream), device, patient).serve, daemon=True).start()


def load(path: Path) -> EmulatedKinect:
    """A camera that shows images in a file of `rendered_images.render`: at first only its first image."""
    with np.load(path) as images:
        streams = {name: PacketStream(FORMS[name], [image.tobytes() for image in images[name]]) for name in images}
    for stream in streams.values():
        stream.play(sys.maxsize, 1)
    return EmulatedKinect(streams)


def main() -> None:
    """Serves until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("root", type=Path)
    parser.add_argument("--sequences", type=Path, nargs="*", help="of each camera; noise if there is none")
    parser.add_argument("--cameras", type=int, default=1)
    parser.add_argument("--patient", action="store_true", help="wait while nobody takes the packets")
    arguments = parser.parse_args()
    with contextlib.suppress(PermissionError):
        os.nice(-15)  # it emulates a kernel, which has priority
    if arguments.sequences:
        kinects = [load(path) for path in arguments.sequences]
    else:
        kinects = [noise(seed=index + 1) for index in range(arguments.cameras)]
    bus = Bus(arguments.root, kinects, arguments.patient)
    commands: Mapping[str, Callable[..., object]] = {
        "unplug": lambda index: bus.plug(int(index), False),
        "plug": lambda index: bus.plug(int(index), True),
        "driver": lambda index, name: bus.hold(int(index), name),
        "disturb": lambda index: setattr(bus.devices[int(index)], "disturbed", True),
        "lose": lambda index, share: bus.lose(int(index), float(share)),
        "late": lambda index: str(len(bus.devices[int(index)].late)),
        "play": lambda begin_ns, rate_hz: bus.play(int(begin_ns), int(rate_hz)),
        "cpu": lambda: f"{time.process_time():.3f}",
    }
    print("ready", flush=True)
    for line in sys.stdin:
        name, *words = line.split()
        print(commands[name](*words) or "done", flush=True)
    os._exit(0)  # connections may still be open


if __name__ == "__main__":
    main()

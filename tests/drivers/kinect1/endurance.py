"""Receives emulated cameras in real time and prints the outcome as one line of JSON per camera.

Run it under umockdev: `testbed.run([sys.executable, "-m", "tests.drivers.kinect1.endurance", SECONDS, …])`.
"""

import argparse
import json
import time
import zlib
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass

from drivers.contract.device import Device, DeviceState, Truth
from drivers.contract.frame import Frame
from drivers.kinect1 import open_device
from drivers.kinect1.reference_plane import ReferencePlane
from tests.drivers.kinect1.emulation.bit_packing import unpack
from tests.drivers.kinect1.emulation.emulated_camera import EmulatedKinect, noise
from tests.drivers.kinect1.emulation.testbed import SERIALS, Server

#: Warm-up of compilers and caches [s].
WARM_UP_S = 3.0


@dataclass(frozen=True)
class Outcome:
    """Outcome of one camera.

    Attributes:
        delivered: frames, of all its streams.
        shown: emulated images from the first to the last delivered one of each stream.
        late: images without a pending transfer, because this process was not scheduled.
        torn: delivered frames that match no emulated image.
        dropped: number of images that the driver counts as dropped.
        cpu_s: CPU time of this process [s].
        emulator_cpu_s: CPU time of the emulator [s].
        duration_s: duration [s].
    """

    delivered: int
    shown: int
    late: int
    torn: int
    dropped: int
    cpu_s: float
    emulator_cpu_s: float
    duration_s: float


class Auditor:
    """A sink that checks each frame and stores none.

    Args:
        kinect: the emulated camera; None to skip the comparison of pixels.
    """

    def __init__(self, kinect: EmulatedKinect | None) -> None:
        self.frames: Counter[str] = Counter()
        self.torn = 0
        self._seqs: defaultdict[str, list[int]] = defaultdict(list)
        self._sums = _checksums(kinect) if kinect else {}

    def on_frame(self, frame: Frame) -> None:
        self.frames[frame.stream] += 1
        first_and_last = self._seqs[frame.stream]
        first_and_last[1:] = [frame.seq] if first_and_last else [frame.seq, frame.seq]
        if self._sums and zlib.crc32(frame.data.tobytes()) not in self._sums[frame.stream]:
            self.torn += 1

    def on_truth(self, truth: Truth) -> None: ...

    def on_state(self, state: DeviceState, reason: str) -> None: ...

    def on_warning(self, condition: str, message: str) -> None: ...

    @property
    def shown(self) -> int:
        """Number of emulated images from the first to the last delivered one."""
        return sum(seqs[-1] - seqs[0] + 1 for seqs in self._seqs.values())


def _checksums(kinect: EmulatedKinect) -> dict[str, set[int]]:
    table = ReferencePlane().table()
    depth = (table[unpack(image, 11)] for image in kinect.packet_streams["depth"].images)
    infrared = (unpack(image, 10).astype("<u2") for image in kinect.packet_streams["ir"].images)
    return {
        "depth": {zlib.crc32(image.tobytes()) for image in depth},
        "ir": {zlib.crc32(image.tobytes()) for image in infrared},
        "bayer": {zlib.crc32(image) for image in kinect.packet_streams["color"].images},
    }


def receive(server: Server, losses: list[float], streams: str, seconds: float, audit: bool) -> list[Outcome]:
    """Receives cameras with the given fractions of packet loss."""
    devices: list[Device] = []
    auditors = [Auditor(noise(seed=index + 1) if audit else None) for index in range(len(losses))]
    for index, (auditor, share) in enumerate(zip(auditors, losses)):
        devices.append(open_device(f"kinect1://{SERIALS[index]}?streams={streams}", time.monotonic_ns))
        server.send(f"lose {index} {share}")
        devices[-1].start(auditor)
    time.sleep(WARM_UP_S)
    begin_s, cpu_s, emulator_cpu_s = time.monotonic(), time.process_time(), float(server.send("cpu"))
    time.sleep(seconds)
    cpu_s = time.process_time() - cpu_s
    emulator_cpu_s = float(server.send("cpu")) - emulator_cpu_s
    duration_s = time.monotonic() - begin_s
    for device in devices:
        device.stop()
    outcomes = []
    for index, (device, auditor) in enumerate(zip(devices, auditors)):
        dropped = sum(device.counters.values()) - device.counters["frames"]
        late = int(server.send(f"late {index}"))
        counts = (auditor.frames.total(), auditor.shown, late, auditor.torn, dropped)
        outcomes.append(Outcome(*counts, cpu_s, emulator_cpu_s, duration_s))
        device.close()
    return outcomes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("losses", type=float, nargs="+", help="share of packets lost by each camera")
    parser.add_argument("--streams", default="depth,color")
    parser.add_argument("--audit", action="store_true", help="compare every frame with what was shown")
    given = parser.parse_args()
    with Server("--cameras", str(len(given.losses))) as emulator:
        for outcome in receive(emulator, given.losses, given.streams, given.seconds, given.audit):
            print(json.dumps(asdict(outcome)), flush=True)

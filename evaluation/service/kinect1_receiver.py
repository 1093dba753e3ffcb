"""Receives emulated cameras in real time and prints the outcome as one line of JSON per camera.

Run it under umockdev: `testbed.run([sys.executable, "-m", "evaluation.service.kinect1_receiver", SECONDS, …])`.
"""

import argparse
import json
import time
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass

from drivers.contract.device import Device, DeviceError, DeviceState, Truth
from drivers.contract.frame import Frame
from drivers.kinect1 import open_device
from evaluation.service.kinect1_emulation.testbed import SERIALS, Server

#: Timeout of the first image of every camera [s].
FIRST_S = 60.0

#: Warm-up of compilers and caches [s].
WARM_UP_S = 3.0


@dataclass(frozen=True)
class Outcome:
    """Outcome of one camera.

    Attributes:
        delivered: frames, of all its streams.
        shown: emulated images from the first to the last delivered one of each stream.
        late: images without a pending transfer, because this process was not scheduled.
        cpu_s: CPU time of this process [s].
        emulator_cpu_s: CPU time of the emulator [s].
        duration_s: duration [s].
    """

    delivered: int
    shown: int
    late: int
    cpu_s: float
    emulator_cpu_s: float
    duration_s: float


class _Counting:
    """A sink that counts the frames and stores none."""

    def __init__(self) -> None:
        self.frames: Counter[str] = Counter()
        self._seqs: defaultdict[str, list[int]] = defaultdict(list)

    def on_frame(self, frame: Frame) -> None:
        self.frames[frame.stream] += 1
        first_and_last = self._seqs[frame.stream]
        first_and_last[1:] = [frame.seq] if first_and_last else [frame.seq, frame.seq]

    def on_truth(self, truth: Truth) -> None: ...

    def on_state(self, state: DeviceState, reason: str) -> None: ...

    def on_warning(self, condition: str, message: str) -> None: ...

    @property
    def shown(self) -> int:
        """Number of emulated images from the first to the last delivered one."""
        return sum(seqs[-1] - seqs[0] + 1 for seqs in self._seqs.values())


def _wait_for_first(sinks: list[_Counting]) -> None:
    end_s = time.monotonic() + FIRST_S
    while not all(sink.frames for sink in sinks):
        if time.monotonic() > end_s:
            raise DeviceError(f"no image arrived within {FIRST_S:g} s")
        time.sleep(0.01)


def receive(server: Server, losses: list[float], streams: str, seconds: float) -> list[Outcome]:
    """Receives cameras with the given fractions of packet loss."""
    devices: list[Device] = []
    sinks = [_Counting() for _ in losses]
    for index, (sink, share) in enumerate(zip(sinks, losses)):
        devices.append(open_device(f"kinect1://{SERIALS[index]}?streams={streams}", time.monotonic_ns))
        server.send(f"lose {index} {share}")
        devices[-1].start(sink)
    _wait_for_first(sinks)
    time.sleep(WARM_UP_S)
    begin_s, cpu_s, emulator_cpu_s = time.monotonic(), time.process_time(), float(server.send("cpu"))
    time.sleep(seconds)
    cpu_s = time.process_time() - cpu_s
    emulator_cpu_s = float(server.send("cpu")) - emulator_cpu_s
    duration_s = time.monotonic() - begin_s
    for device in devices:
        device.stop()
    outcomes = []
    for index, (device, sink) in enumerate(zip(devices, sinks)):
        late = int(server.send(f"late {index}"))
        counts = (sink.frames.total(), sink.shown, late)
        outcomes.append(Outcome(*counts, cpu_s, emulator_cpu_s, duration_s))
        device.close()
    return outcomes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("losses", type=float, nargs="+", help="share of packets lost by each camera")
    parser.add_argument("--streams", default="depth,color")
    given = parser.parse_args()
    with Server("--cameras", str(len(given.losses))) as emulator:
        for outcome in receive(emulator, given.losses, given.streams, given.seconds):
            print(json.dumps(asdict(outcome)), flush=True)

"""What receiving a Kinect v1 costs and loses, on unmodified libusb with an emulated camera behind it.

python -m evaluation.service.kinect1 --seconds 20
"""

import argparse
import json
import sys
import time

import numpy as np

from drivers.kinect1 import unpacking
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.transport.packets import DEPTH
from tests.drivers.kinect1 import testbed
from tests.drivers.kinect1.endurance import Outcome

#: Streams, and the share of packets lost by each camera.
CASES = (
    ("depth", (0.0,)),
    ("color", (0.0,)),
    ("ir", (0.0,)),
    ("depth,color", (0.0,)),
    ("depth,color", (0.01,)),
    ("depth,color", (0.0, 0.0)),
)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each case")
    seconds = parser.parse_args().seconds
    print("| cameras | streams | packets lost | whole | whole of those in time | CPU per stream | emulator |")
    print("|---|---|---|---|---|---|---|")
    for streams, losses in CASES:
        outcomes = _measure(streams, losses, seconds)
        delivered, shown = sum(one.delivered for one in outcomes), sum(one.shown for one in outcomes)
        in_time = shown - sum(one.late for one in outcomes)
        count = len(losses) * len(streams.split(","))
        cpu, emulator = (outcomes[0].cpu_s / count, outcomes[0].emulator_cpu_s / count)
        whole, punctual = delivered / shown, min(delivered / in_time, 1)
        print(
            f"| {len(losses)} | {streams} | {losses[0]:.0%} | {whole:.2%} | {punctual:.2%} "
            f"| {cpu / outcomes[0].duration_s:.1%} of a core | {emulator / outcomes[0].duration_s:.1%} |",
            flush=True,
        )
    print(f"\nunpacking a depth image and looking its distances up: {_unpacking_ms():.2f} ms")


def _measure(streams: str, losses: tuple[float, ...], seconds: float) -> list[Outcome]:
    program = [sys.executable, "-m", "tests.drivers.kinect1.endurance", str(seconds), *map(str, losses)]
    done = testbed.run([*program, "--streams", streams], timeout_s=seconds + 120, cameras=len(losses))
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return [Outcome(**json.loads(line)) for line in done.stdout.splitlines()]


def _unpacking_ms() -> float:
    packed = np.random.default_rng(1).integers(0, 256, DEPTH.image_bytes, np.uint8)
    table = ReferencePlane().table()
    unpacking.depth(packed, table, DEPTH.height, DEPTH.width)
    begin_s = time.process_time()
    for _ in range(100):
        unpacking.depth(packed, table, DEPTH.height, DEPTH.width)
    return 10 * (time.process_time() - begin_s)


if __name__ == "__main__":
    main()

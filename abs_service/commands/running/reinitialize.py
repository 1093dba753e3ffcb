"""Makes a running tracker detect its object again, with a new mesh from its region's current image.

  abs-service reinitialize                  the tracker of the demo rig that `abs-service run` shows elsewhere
  abs-service reinitialize rig.toml sheet   one tracker of that rig
  abs-service reinitialize rig.toml sheet --seed 111 133   the object that this pixel of the depth image shows

A tracker that has lost its object does so by itself; this is for another object, or for a better view of the same.
"""

import argparse
import threading

from absmsg.v1 import deformation_state_pb2

from abs_service import wiring
from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.supervision.exit_codes import Exit
from abs_service.wire import commands
from drivers.encoding.message_check import LARGEST_SIDE

#: Timeout of the detection [s].
TIMEOUT_S = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service reinitialize`."""
    rig_process.add_arguments(parser)
    parser.add_argument("tracker", metavar="TRACKER", nargs="?", help="its name (default: the first one)")
    parser.add_argument(
        "--seed", metavar=("U", "V"), nargs=2, type=_place,
        help="column and row of a pixel of the object in the depth image of the tracker's reference sensor, "
        "instead of the region of the rig file",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Sends the command and waits for the new mesh."""
    settings = rig_process.load_config(arguments)
    name = arguments.tracker or next(iter(settings.trackers), "")
    wiring.plan(settings, name)
    seed = (arguments.seed[0], arguments.seed[1]) if arguments.seed else None
    with rig_process.open_bus(settings, arguments, "operator") as bus:
        return request(bus, name, HeaderFactory(settings.name, WallClock()), seed)


def request(bus: Bus, tracker: str, headers: HeaderFactory, seed: tuple[int, int] | None = None) -> int:
    """Sends the command once the tracker's first state shows that it runs, and waits for another mesh version."""
    versions: list[int] = []
    received, renewed = threading.Event(), threading.Event()

    def on_state(sample: Sample) -> None:
        state = deformation_state_pb2.DeformationState.FromString(sample.payload)
        versions.append(state.mesh_version)
        received.set()
        if state.mesh_version != versions[0]:
            renewed.set()

    bus.subscribe(keys.state(tracker), on_state)
    if not received.wait(TIMEOUT_S):
        print(f'tracker "{tracker}" publishes nothing: does it run, and do its sensors deliver?')
        return Exit.FAILED
    answer = commands.reinitialize(bus, tracker, headers, TIMEOUT_S, seed)
    if answer is None or not answer.accepted:
        print(f'tracker "{tracker}" refuses: {answer.reason if answer else "it gives no answer"}')
        return Exit.FAILED
    if not renewed.wait(TIMEOUT_S):
        print(f'tracker "{tracker}" found no object within {TIMEOUT_S:.0f} s; it goes on as it was')
        return Exit.FAILED
    print(f'tracker "{tracker}" has a new mesh, version {versions[-1]}')
    if answer.region:
        print(f"to keep it, write into the rig file, in place of its region:\n\n{answer.region}", end="")
    return Exit.OK


def _place(text: str) -> int:
    if not (text.isdecimal() and int(text) < LARGEST_SIDE):
        raise argparse.ArgumentTypeError(f"{text!r} is no column or row of an image")
    return int(text)

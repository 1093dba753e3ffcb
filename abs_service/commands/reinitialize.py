"""Makes a running tracker detect its object again, with a new mesh of what its region shows now.

  abs-service reinitialize                  the tracker of the demo rig that `abs-service run` shows elsewhere
  abs-service reinitialize rig.toml sheet   one tracker of that rig

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

#: Timeout of the detection [s].
TIMEOUT_S = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service reinitialize`."""
    rig_process.add_arguments(parser)
    parser.add_argument("tracker", metavar="TRACKER", nargs="?", help="its name (default: the first one)")


def run(arguments: argparse.Namespace) -> int:
    """Sends the command and waits for the new mesh."""
    settings = rig_process.load_config(arguments)
    name = arguments.tracker or next(iter(settings.trackers), "")
    wiring.plan(settings, name)
    with rig_process.open_bus(settings, arguments, "operator") as bus:
        return request(bus, name, HeaderFactory(settings.name, WallClock()))


def request(bus: Bus, tracker: str, headers: HeaderFactory) -> int:
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
    answer = commands.reinitialize(bus, tracker, headers, TIMEOUT_S)
    if answer is None or not answer.accepted:
        print(f'tracker "{tracker}" refuses: {answer.reason if answer else "it gives no answer"}')
        return Exit.FAILED
    if not renewed.wait(TIMEOUT_S):
        print(f'tracker "{tracker}" found no object within {TIMEOUT_S:.0f} s; it goes on as it was')
        return Exit.FAILED
    print(f'tracker "{tracker}" has a new mesh, version {versions[-1]}')
    return Exit.OK

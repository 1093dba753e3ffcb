"""Makes a running tracker detect its object again, with a new mesh from its region's current image.

  abs-service reinitialize                  the tracker of the demo rig that `abs-service run` shows elsewhere
  abs-service reinitialize rig.toml sheet   one tracker of that rig
  abs-service reinitialize rig.toml sheet --seed 111 133   the object that this pixel of the depth image shows
  abs-service reinitialize rig.toml sheet --box 80 90 160 170   the nearest object in this box of it

A tracker that has lost its object does so by itself; this is for another object, or for a better view of the same.
"""

import argparse
import threading
from typing import Any

from absmsg.v1 import deformation_state_pb2

from abs_service import wiring
from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.options import whole
from abs_service.supervision.exit_codes import Exit
from abs_service.wire import commands
from drivers.encoding.message_check import MAX_SIDE_PX
from drivers.encoding.message_content import MAX_CORNERS, MIN_CORNERS

#: Timeout of the detection [s].
TIMEOUT_S = 10.0

_PIXEL = whole(MAX_SIDE_PX - 1, "a column or row of an image")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service reinitialize`."""
    rig_process.add_arguments(parser)
    parser.add_argument("tracker", metavar="TRACKER", nargs="?", help="its name (default: the first one)")
    where = parser.add_argument_group(
        "the object, in the depth image of the tracker's reference sensor, instead of the region of the rig file"
    ).add_mutually_exclusive_group()
    where.add_argument("--seed", metavar=("U", "V"), nargs=2, type=_PIXEL, help="column and row of a pixel of it")
    where.add_argument(
        "--box", metavar=("U", "V", "U2", "V2"), nargs=4, type=_PIXEL,
        help="first and last column and row of a box around it",
    )  # fmt: skip
    where.add_argument(
        "--polygon", metavar="U V", nargs="+", type=_PIXEL, action=_Polygon,
        help=f"column and row of each corner, {MIN_CORNERS} to {MAX_CORNERS}, of a polygon around it",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Sends the command and waits for the new mesh."""
    settings = rig_process.load_config(arguments)
    name = arguments.tracker or next(iter(settings.trackers), "")
    wiring.plan(settings, name)
    choice = _choice(arguments)
    with rig_process.open_bus(settings, arguments, "operator") as bus:
        return request(bus, name, HeaderFactory(settings.name, WallClock()), choice)


def request(bus: Bus, tracker: str, headers: HeaderFactory, choice: commands.Choice = commands.AS_CONFIGURED) -> int:
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
    answer = commands.reinitialize(bus, tracker, headers, TIMEOUT_S, choice)
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


class _Polygon(argparse.Action):
    """Makes pairs of columns and rows."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Sets the argument to the corners; ends the program if a row is missing, or the number is not allowed."""
        corners = tuple(zip(values[::2], values[1::2]))
        if len(values) % 2 or not MIN_CORNERS <= len(corners) <= MAX_CORNERS:
            allowed = f"{MIN_CORNERS} to {MAX_CORNERS} corners have a column and a row each"
            raise argparse.ArgumentError(self, f"{len(values)} numbers; {allowed}")
        namespace.polygon = corners


def _choice(arguments: argparse.Namespace) -> commands.Choice:
    if arguments.seed:
        return commands.Choice(seed=tuple(arguments.seed))
    if arguments.box:
        return commands.Choice(polygon=commands.box(*arguments.box))
    return commands.Choice(polygon=arguments.polygon or ())

"""Makes a running rig read its file again: what is concerned starts anew, everything else goes on.

  abs-service reload rig.toml                                     as this host's rig was started with it
  abs-service reload rig.toml --connect tcp/192.168.1.7:7447      on another host, where the file of that host is read

A tracker starts again if its table, one of its sensors or their devices have changed, and then detects its object
anew; other trackers keep theirs, also when one is added or removed. The devices start again if they, or the cameras of
their sensors, have changed. The recorder begins another file, because a recording has one configuration. The file is
checked first, as `abs-service check` does; if something is wrong with it, or a key has changed that cannot change while
the rig runs, all stays as it was.
"""

import argparse

from abs_service.bus.contract import Bus
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.supervision.exit_codes import Exit
from abs_service.wire import commands

#: Timeout of the answer: the rig reads and checks the file first [s].
TIMEOUT_S = 30.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service reload`."""
    rig_process.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Sends the command and prints the answer."""
    rig = rig_process.load_config(arguments)
    with rig_process.open_bus(rig, arguments, "operator") as bus:
        return request(bus, HeaderFactory(rig.name, WallClock()))


def request(bus: Bus, headers: HeaderFactory) -> int:
    """Sends the command and prints the answer."""
    answer = commands.reload(bus, headers, TIMEOUT_S)
    if answer is None:
        print(
            f'no `abs-service run` of a rig "{headers.rig}" answers there. '
            "If `name` or `bus.endpoint` has changed, stop the rig and start it again"
        )
        return Exit.FAILED
    if not answer.accepted:
        print(f"the rig refuses: {answer.reason}")
        return Exit.FAILED
    changes = (("starts again", answer.restarts), ("ends", answer.ends))
    print("; ".join(f"{what}: {', '.join(names)}" for what, names in changes if names) or "nothing has changed")
    return Exit.OK

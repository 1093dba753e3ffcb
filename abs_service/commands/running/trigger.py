"""Makes a running recorder record, from some seconds before now, or lets it wait again.

  abs-service trigger                  of the demo rig that `abs-service run` shows elsewhere
  abs-service trigger rig.toml         begins, with the last `record.pre_roll_s` seconds
  abs-service trigger rig.toml --stop  ends

The rig needs `record.when = "requested"` or `"not_tracking"`.
"""

import argparse

from abs_service.bus.contract import Bus
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.supervision.exit_codes import Exit
from abs_service.wire import commands

#: Timeout of the answer [s].
TIMEOUT_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service trigger`."""
    rig_process.add_arguments(parser)
    parser.add_argument("--stop", action="store_true", help="end the recording, instead of beginning one")


def run(arguments: argparse.Namespace) -> int:
    """Sends the command and prints the answer."""
    rig = rig_process.load_config(arguments)
    with rig_process.open_bus(rig, arguments, "operator") as bus:
        return request(bus, HeaderFactory(rig.name, WallClock()), not arguments.stop)


def request(bus: Bus, headers: HeaderFactory, recording: bool) -> int:
    """Sends the command and prints the answer."""
    answer = commands.record(bus, headers, recording, TIMEOUT_S)
    if answer is None or not answer.accepted:
        print(f"the recorder refuses: {answer.reason if answer else 'it gives no answer; does it run?'}")
        return Exit.FAILED
    print("the recorder records" if recording else "the recorder waits")
    return Exit.OK

"""Shows a rig or a recording in the browser: deforming mesh, measured points, images, status in words, plots.

  abs-service view                                          the demo rig that `abs-service run` shows elsewhere
  abs-service view rig.toml --connect tcp/192.168.1.7:7447  a rig on another host
  abs-service view rig.toml --view-only                     without anything that acts on the rig
  abs-service view left.toml right.toml                     several rigs, each on a page with links to the others
  abs-service view recordings/x.mcap                        a recording, with a time slider

`abs-service run --view` serves the same page. It can be opened on this host only; Ctrl-C ends it.
"""

import argparse
from importlib.util import find_spec
from pathlib import Path

from abs_service.commands.parts import rig_process
from abs_service.commands.parts.options import OptionError, port
from abs_service.supervision.exit_codes import Exit
from drivers.contract.errors import install_extra

PORT = 8080

#: Endings of recordings, finished or not.
RECORDINGS = (".mcap", ".active")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service view`."""
    rig_process.add_arguments(parser, "TOML file of the rig, or a recording (.mcap)")
    parser.add_argument("others", metavar="CONFIG", nargs="*", type=Path, help="TOML files of other rigs")
    parser.add_argument(
        "--port", metavar="N", type=port, default=PORT, help=f"port of the page (default: {PORT}), of several the first"
    )
    parser.add_argument("--view-only", action="store_true", help="leave out everything that acts on the rig")


def check() -> None:
    """Checks that viser is installed.

    Raises:
        OptionError: it is not installed.
    """
    if find_spec("viser") is None:
        raise OptionError(f"the page needs viser: {install_extra('view')} in the clone")


def run(arguments: argparse.Namespace) -> int:
    """Serves pages until SIGTERM or SIGINT."""
    check()
    from abs_service.commands.running import pages  # noqa: PLC0415 - needs viser

    files = [one for one in (arguments.config, *arguments.others) if one is not None]
    recordings = [one for one in files if one.suffix in RECORDINGS]
    if recordings and (arguments.connect or arguments.listen):
        raise OptionError(f"{recordings[0]}: a recording is read from its file; leave out --connect and --listen")
    if recordings and arguments.others:
        raise OptionError(f"{recordings[0]}: a recording is shown alone")
    if arguments.others and (arguments.connect or arguments.listen):
        raise OptionError("each of several rigs has the endpoint of its file; leave out --connect and --listen")
    if recordings:
        pages.play(recordings[0], arguments.port)
    else:
        pages.serve(arguments)
    return Exit.OK

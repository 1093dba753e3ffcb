"""Shows a rig or a recording in the browser: deforming mesh, measured points, images, status in words, plots.

  abs-service view                                          the demo rig that `abs-service run` shows elsewhere
  abs-service view rig.toml --connect tcp/192.168.1.7:7447  a rig on another host
  abs-service view rig.toml --view-only                     without anything that acts on the rig
  abs-service view recordings/x.mcap                        a recording, with a time slider

`abs-service run --view` serves the same page. It can be opened on this host only; Ctrl-C ends it.
"""

import argparse
import time
from collections.abc import Mapping
from importlib.util import find_spec

from absmsg.v1.command_pb2 import CommandAnswer

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.supervision.exit_codes import Exit
from abs_service.wire import commands, control_commands
from drivers.contract.controls import Value

PORT = 8080

#: Endings of recordings, finished or not.
RECORDINGS = (".mcap", ".active")

#: Time that a tracker or the recorder has to answer a command [s].
ANSWER_S = 3.0


class ViewError(Exception):
    """The page cannot be served."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service view`."""
    rig_process.add_arguments(parser, "TOML file of the rig, or a recording (.mcap)")
    parser.add_argument("--port", metavar="N", type=int, default=PORT, help=f"port of the page (default: {PORT})")
    parser.add_argument("--view-only", action="store_true", help="leave out everything that acts on the rig")


def check() -> None:
    """Refuses to go on without viser.

    Raises:
        ViewError: it is not installed.
    """
    if find_spec("viser") is None:
        raise ViewError("the page needs viser: .venv/bin/pip install -e '.[view]' in the clone")


def run(arguments: argparse.Namespace) -> int:
    """Serves the page until SIGTERM or SIGINT."""
    check()
    if arguments.config and arguments.config.suffix in RECORDINGS:
        return _play(arguments)
    from abs_service.display.page.commands import Commands  # noqa: PLC0415 - needs viser
    from abs_service.display.page.feed import Feed  # noqa: PLC0415 - needs viser
    from abs_service.display.page.page import Page  # noqa: PLC0415 - needs viser

    rig = rig_process.load_config(arguments)
    stop = rig_process.stop_on_signals()
    headers = HeaderFactory(rig.name, WallClock())
    with rig_process.open_bus(rig, arguments, "viewer", "operator") as bus:
        health = Health(bus, "view", headers)

        def reinitialize(tracker: str, choice: commands.Choice) -> CommandAnswer | None:
            return commands.reinitialize(bus, tracker, headers, ANSWER_S, choice)

        def record(recording: bool) -> CommandAnswer | None:
            return commands.record(bus, headers, recording, ANSWER_S)

        def control(device: str, values: Mapping[str, Value]) -> CommandAnswer | None:
            return control_commands.set_controls(bus, device, headers, ANSWER_S, values)

        feed = Feed(bus, time.monotonic_ns)
        endpoint = arguments.connect or rig.bus.endpoint
        silence = f"Is abs-service running at {endpoint}? This page connects again by itself; what it shows is old."
        references = {name: rig.reference(name)[0] for name in rig.trackers}
        to_rig = Commands(reinitialize, record, control, references, tuple(rig.devices))
        page = Page(feed, silence, arguments.port, arguments.view_only, to_rig, time.monotonic_ns)
        print(f"live page: {page.url}", flush=True)
        try:
            page.run(stop, health.tick)
        finally:
            page.close()
    return Exit.OK


def _play(arguments: argparse.Namespace) -> int:
    """Serves a page of a recording."""
    from abs_service.display.page.commands import NONE  # noqa: PLC0415 - needs viser
    from abs_service.display.page.feed import Feed  # noqa: PLC0415 - needs viser
    from abs_service.display.page.page import Page  # noqa: PLC0415 - needs viser
    from abs_service.display.page.playback import Playback  # noqa: PLC0415 - needs viser
    from abs_service.display.page.player import Player  # noqa: PLC0415 - needs viser

    if arguments.connect or arguments.listen:
        raise ViewError(f"{arguments.config}: a recording is read from its file; leave out --connect and --listen")
    playback = Playback(arguments.config, time.monotonic_ns)
    stop = rig_process.stop_on_signals()
    silence = f"{arguments.config.name} has no messages of this time."
    feed = Feed(playback, playback.now_ns)
    page = Page(feed, silence, arguments.port, True, NONE, time.monotonic_ns)
    player = Player(page.gui, playback)
    print(f"page of {arguments.config}: {page.url}", flush=True)
    try:
        page.run(stop, player.tick)
    finally:
        page.close()
    return Exit.OK

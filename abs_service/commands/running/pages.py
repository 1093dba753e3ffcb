"""Pages of `abs-service view`: one for each rig, or one for a recording."""

import argparse
import errno
import socket
import time
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack
from pathlib import Path

from absmsg.v1.command_pb2 import CommandAnswer

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.options import LAST_PORT, OptionError
from abs_service.display.page import style
from abs_service.display.page.acting.commands import NONE, Commands
from abs_service.display.page.feed import Feed
from abs_service.display.page.page import HOST, Page
from abs_service.display.page.playback import Playback
from abs_service.display.page.player import Player
from abs_service.display.page.readouts.neighbours import Neighbour
from abs_service.wire import commands, control_commands
from drivers.contract.controls import Value

#: Time that a tracker, the recorder or a device has to answer a command [s].
ANSWER_S = 3.0


def free_port(first: int) -> int:
    """The first free port of this host from `first` on; 0 for any.

    viser looks for it as well, but never returns if there is none.

    Raises:
        OptionError: there is none, or this host has no loopback address of IPv4.
        OSError: it lacks open files, say.
    """
    for port in range(first, LAST_PORT + 1):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as viser does
            try:
                probe.bind((HOST, port))
                probe.listen()
            except OSError as error:
                if error.errno == errno.EADDRNOTAVAIL:
                    raise OptionError(f"--port {port}: cannot listen at {HOST}: {error.strerror}") from None
                if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                    raise
                continue
            return port
    raise OptionError(f"--port {first}: no port from there to {LAST_PORT} is free; choose a lower one")


def serve(arguments: argparse.Namespace) -> None:
    """Serves a page of each rig until SIGTERM or SIGINT."""
    stop = rig_process.stop_on_signals()
    with ExitStack() as opened:
        shown = [
            _open(argparse.Namespace(**vars(arguments) | {"config": file}), opened)
            for file in (arguments.config, *arguments.others)
        ]
        for page, _, rig in shown:
            page.neighbours = [other for *_, other in shown if other is not rig]
            print(f"live page{f' of {rig.name}' if arguments.others else ''}: {page.url}", flush=True)
        with ThreadPoolExecutor(len(shown)) as threads:
            running = [threads.submit(page.run, stop, health.tick) for page, health, _ in shown]
            wait(running, return_when=FIRST_COMPLETED)
            stop.set()  # one of them has failed, if nobody else has
        for one in running:
            one.result()


def _open(arguments: argparse.Namespace, opened: ExitStack) -> tuple[Page, Health, Neighbour]:
    rig = rig_process.load_config(arguments)
    headers = HeaderFactory(rig.name, WallClock())
    bus = opened.enter_context(rig_process.open_bus(rig, arguments, "viewer", "operator"))
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
    page = Page(feed, silence, free_port(arguments.port), arguments.view_only, to_rig, time.monotonic_ns)
    style.show_name(page.gui, rig.name)
    opened.callback(page.close)
    return page, health, Neighbour(rig.name, page.url, feed, silence)


def play(recording: Path, port: int) -> None:
    """Serves a page of a recording until SIGTERM or SIGINT."""
    playback = Playback(recording, time.monotonic_ns)
    stop = rig_process.stop_on_signals()
    feed = Feed(playback, playback.now_ns)
    page = Page(feed, f"{recording.name} has no messages of this time.", free_port(port), True, NONE, time.monotonic_ns)
    style.show_name(page.gui, recording.name)
    player = Player(page.gui, playback)
    print(f"page of {recording}: {page.url}", flush=True)
    try:
        page.run(stop, player.tick)
    finally:
        page.close()

"""Tracks live: starts, supervises and displays the devices, the trackers and the recorder of a rig.

  abs-service run                            the simulated demo rig, nothing to connect or configure
  abs-service run rig.toml --out takes       your own sensors, recorded to takes/
  abs-service run --no-record --json         one JSON object per estimate, for scripts
  abs-service run --view                     with a page in the browser that shows mesh, points and images
  abs-service run --seed 3 --duration 20     another simulated motion, for 20 s
  abs-service run rig.toml --connect tcp/192.168.1.7:7447    tracks and records what `capture --listen` takes there

Applications connect to bus.endpoint; the keys are abs/<rig>/<tracker>/state and so on. Ctrl-C ends everything in order.
"""

import argparse
import logging
import os
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from abs_service import config
from abs_service.bus import keys
from abs_service.bus.session import SessionMode, check_endpoint
from abs_service.bus.stamps import WallClock
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.log import logs, notes
from abs_service.commands.parts.options import port, whole
from abs_service.commands.parts.rig_in_memory import RigInMemory, in_memory
from abs_service.commands.running import outcome, settled_file, view
from abs_service.display.terminal import choice
from abs_service.recording.disk import folder
from abs_service.supervision.children import forked
from abs_service.supervision.children.child import Child
from abs_service.supervision.children.child_process import ChildProcess, Process, Spawn
from abs_service.supervision.display import Display
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.health import metrics, systemd
from abs_service.supervision.health.rig_view import RigPlaces
from abs_service.supervision.limits import Limits
from abs_service.supervision.process_setup import log_lines
from abs_service.supervision.repeats import Tracebacks
from abs_service.supervision.run_session import Renewal, RunSession
from abs_service.supervision.supervisor import Supervisor
from abs_service.wire.commands import RefusedError

#: Type of --seed, with the limits of a simulated device.
SEED = whole(2**32 - 1, "a whole number")
#: Receives the lines of a child's output, with its name.
PassOn = Callable[[str, str], None]


class ChildError(Exception):
    """A child cannot work until the user changes something; the message is the child's own."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service run`."""
    rig_process.add_config(parser)
    forever = rig_process.MAX_DURATION_S
    parser.add_argument(
        "--duration", metavar="S", type=rig_process.seconds, default=forever, help="end after this many seconds"
    )
    parser.add_argument("--no-record", action="store_true", help="keep nothing on disk")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the recordings instead of record.directory")
    parser.add_argument("--rig", metavar="NAME", help="name on the wire instead of the configuration's")
    devices = parser.add_mutually_exclusive_group()
    devices.add_argument("--seed", metavar="N", type=SEED, help="seed of all simulated devices")
    devices.add_argument(
        "--connect", metavar="ENDPOINT", default="", help="open no device: `capture` does, which listens here"
    )
    parser.add_argument("--view", action="store_true", help="serve a page that shows the rig, as `abs-service view`")
    parser.add_argument("--view-port", metavar="N", type=port, help=f"--view at this port (default: {view.PORT})")
    parser.add_argument("--view-only", action="store_true", help="--view without anything that acts on the rig")
    parser.add_argument("--json", action="store_true", help="print one JSON object per estimate instead of a table")


def run(arguments: argparse.Namespace) -> int:
    """Runs a rig until SIGTERM or SIGINT, the end of its devices, or a failure."""
    page = page_options(arguments)
    if page is not None:
        view.check()
    rig = effective(rig_process.load_config(arguments), arguments)
    if rig.record.enabled:
        folder.check(rig.record.directory)
    # A working directory can be deleted, and its names are read again.
    arguments.config, arguments.out = (
        path and Path(os.path.abspath(path)) for path in (arguments.config, arguments.out)
    )
    stop = rig_process.stop_on_signals()
    with (
        rig_process.open_bus_at(rig.bus.endpoint, SessionMode.ROUTER, rig, arguments) as bus,
        in_memory(rig, config.named(arguments.config)) as file,
        choice.shown(as_json=arguments.json) as display,
        notes.logging_to(display, logs.on_stderr(arguments)) if not arguments.log_file else nullcontext(),
        metrics.served(rig.run.metrics_port) as measure,
    ):
        starts = starting(display, arguments)
        processes = children(rig, file.path, page, arguments.connect)
        supervisor = Supervisor(processes, starts, time.monotonic_ns, limits(rig))
        places = RigPlaces(rig.name, rig.bus.endpoint, rig.record.directory, captured_at=arguments.connect)
        notifier = systemd.notifier(os.environ)
        watchers = (notifier.update, measure, lambda _: forked.ensure_running())
        clock = WallClock()
        session = RunSession(bus, places, rig.trackers, supervisor, display, clock, watchers)
        session.answer_reloads(partial(renewal, file, arguments, page))
        rig_process.on_hangup(session.reload, stop)
        try:
            session.run_until(lambda: stop.is_set() or session.elapsed_s >= arguments.duration)
        finally:
            notifier.stopping()
            session.stop()
        last = session.view()
        lost = display.close(last)
    refused = supervisor.misconfigured()
    if refused is not None:
        raise ChildError(log_lines.final_error(refused.reason))
    return supervisor.exit_code() or (Exit.FAILED if lost else outcome.code(last, stop.is_set()))


def effective(rig: config.ServiceConfig, arguments: argparse.Namespace) -> config.ServiceConfig:
    """The configuration, overridden by the command line.

    Raises:
        KeyNameError: the rig cannot be called so.
        BusError: no other host can be reached so.
    """
    record = {"enabled": rig.record.enabled and not arguments.no_record}
    if arguments.out:
        record["directory"] = arguments.out.absolute()
    devices = rig.devices
    if arguments.seed is not None:
        devices = {
            name: device.model_copy(update={"uri": with_seed(device.uri, arguments.seed)})
            for name, device in devices.items()
        }
    routers = rig.bus.routers
    if arguments.connect:
        routers = (*routers, check_endpoint(arguments.connect, rig.bus.security(), "--connect"))
    changes = {
        "name": keys.check_name(rig.name if arguments.rig is None else arguments.rig),
        "bus": rig.bus.model_copy(update={"routers": routers}),
        "devices": devices,
        "record": rig.record.model_copy(update=record),
    }
    return rig.model_copy(update=changes)


def read_again(arguments: argparse.Namespace) -> config.ServiceConfig:
    """The configuration that the rig file has now, checked, and overridden by the command line.

    Raises:
        ConfigError: it cannot be used.
        CheckError: something that it names does not exist or cannot be made.
        FolderError: its folder of recordings cannot be used.
    """
    from abs_service.commands import check  # noqa: PLC0415 - needs all parts of trackers, which this process has not

    rig = effective(rig_process.load_config(arguments), arguments)
    check.describe(rig, str(arguments.config))
    if rig.record.enabled:
        folder.check(rig.record.directory)
    return rig


def renewal(file: RigInMemory, arguments: argparse.Namespace, page: Sequence[str] | None) -> Renewal:
    """Lets the file have the configuration that the rig file has now; returns what follows for the processes.

    Raises:
        RefusedError: it cannot be taken over, or no file was given.
    """
    if not arguments.config:
        raise RefusedError("it is the demo rig, which no file describes")
    read = partial(settled_file.read, arguments.config, partial(read_again, arguments), file.lacks_some)
    changes = file.exchange(read)
    for component in changes.ends:
        logging.getLogger(__name__).warning("%s ends: %s has it no longer", component, arguments.config)
    processes = children(file.rig, file.path, page, arguments.connect)
    return Renewal(file.rig.record.directory, processes, changes.components, changes.ends)


def page_options(arguments: argparse.Namespace) -> list[str] | None:
    """Options of `abs-service view` for the page of `run`; None if it serves none."""
    number, only = arguments.view_port, arguments.view_only
    if not (arguments.view or only or number is not None):
        return None
    return [*(["--port", str(number)] if number is not None else []), *(["--view-only"] if only else [])]


def with_seed(uri: str, seed: int) -> str:
    """The address of a simulated device with another seed; any other address as it is."""
    parts = urlsplit(uri)
    if parts.scheme != "simulated":
        return uri
    query = dict(parse_qsl(parts.query, keep_blank_values=True)) | {"seed": str(seed)}
    return urlunsplit(parts._replace(query=urlencode(query, safe=",")))


def children(
    rig: config.ServiceConfig, path: Path, page: Sequence[str] | None = None, captured_at: str = ""
) -> list[Child]:
    """The processes of a rig; the recorder is to stop last.

    Args:
        rig: the effective configuration.
        path: the file that it is in.
        page: options of `abs-service view`; None: without it.
        captured_at: endpoint of the host that captures; "" if this one does.
    """
    captures = [] if captured_at else [Child("capture", ("capture", str(path)), 0)]
    trackers = [Child(f"track/{name}", ("track", str(path), name), 1) for name in rig.trackers]
    recorder = [Child("record", ("record", str(path)), 2)] if rig.record.enabled else []
    pages = [] if page is None else [Child("view", ("view", str(path), *page), 0)]
    return [*captures, *trackers, *recorder, *pages]


def limits(rig: config.ServiceConfig) -> Limits:
    """Limits and timeouts of the configuration."""
    table = rig.run
    seconds = (table.restart_window_s, table.startup_timeout_s, table.stall_timeout_s, table.stop_timeout_s)
    return Limits(table.max_restarts, *(int(value * 1e9) for value in seconds))


def starting(display: Display, arguments: argparse.Namespace) -> Spawn:
    """Starts child processes, which log as this one does."""
    pass_on = partial(_pass_on, display, logs.on_stderr(arguments), Tracebacks())
    return partial(spawn, pass_on, logs.options(arguments))


def spawn(pass_on: PassOn, log_options: Sequence[str], component: str, arguments: Sequence[str]) -> Process:
    """Starts a child process."""
    return ChildProcess(component, [*arguments, *log_options], pass_on)


def _pass_on(display: Display, as_json: bool, tracebacks: Tracebacks, component: str, written: str) -> None:
    # An error that ends a child is what this process will end with, and say once.
    if not written or log_lines.is_final(written):
        return
    for line in tracebacks.take(component, written, time.monotonic_ns()):
        if as_json:
            display.note(line if log_lines.parse(line) else log_lines.line(time.time(), "info", component, line, {}))
        else:
            display.note(f"{component}: {line}")

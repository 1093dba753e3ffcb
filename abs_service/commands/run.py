"""Tracks live: starts the devices, the trackers and the recorder of a rig, looks after them and shows how they are.

  abs-service run                            the simulated demo rig, nothing to connect or configure
  abs-service run rig.toml --out takes       your own sensors, recorded to takes/
  abs-service run --no-record --json         one JSON object per estimate, for scripts
  abs-service run --seed 3 --duration 20     another simulated motion, for 20 s

Applications connect to bus.endpoint; the keys are abs/<rig>/<tracker>/state and so on. Ctrl-C ends everything in order.
"""

import argparse
import logging
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

from rich.console import Console

from abs_service import config
from abs_service.bus import keys
from abs_service.bus.session import Role
from abs_service.bus.stamps import WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.commands.parts import rig_process
from abs_service.display.lines import JsonDisplay, PlainDisplay
from abs_service.display.table import TableDisplay
from abs_service.supervision import gc_tuning
from abs_service.supervision.child_process import ChildProcess, Process
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.rig_view import Display
from abs_service.supervision.run_session import RunSession
from abs_service.supervision.supervisor import Child, Limits, Supervisor
from abs_service.wire.checked_bus import CheckedBus


class ChildError(Exception):
    """A child cannot work until the user changes something; the message is the child's own."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service run`."""
    rig_process.add_config(parser)
    parser.add_argument("--duration", metavar="S", type=float, default=float("inf"), help="end after this many seconds")
    parser.add_argument("--no-record", action="store_true", help="keep nothing on disk")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the recordings instead of record.directory")
    parser.add_argument("--rig", metavar="NAME", help="name on the wire instead of the configuration's")
    parser.add_argument("--seed", metavar="N", type=int, help="seed of all simulated devices")
    parser.add_argument("--json", action="store_true", help="print one JSON object per estimate instead of a table")


def run(arguments: argparse.Namespace) -> int:
    """Runs a rig until SIGTERM or SIGINT, the end of its devices, or a failure."""
    rig = effective(rig_process.load_config(arguments), arguments)
    stop = rig_process.stop_on_signals()
    gc_tuning.shorten_switch_interval()  # what the router passes on may have to wait for the threads of this process
    where = (rig.bus.endpoint, Role.ROUTER)
    with (
        CheckedBus(ZenohBus.open(rig.name, *where, rig.bus.shared_memory), time.monotonic_ns) as bus,
        file(rig) as path,
        make_display(as_json=arguments.json) as display,
        _logging_to(display),
    ):
        starts = partial(spawn, display, path, config.to_toml(rig))
        supervisor = Supervisor(children(rig, path), starts, time.monotonic_ns, limits(rig))
        about = (rig.name, rig.bus.endpoint, rig.record.directory)
        session = RunSession(bus, *about, rig.trackers, supervisor, display, WallClock())
        try:
            session.run_until(lambda: stop.is_set() or session.elapsed_s >= arguments.duration)
        finally:
            session.stop()
        display.close(session.view())
    refused = supervisor.misconfigured()
    if refused is not None:
        # The child has read a temporary file of ours.
        reason = refused.reason.rpartition("abs-service: error: ")[2]
        raise ChildError(reason.replace(str(path), str(arguments.config or "demo.toml")))
    return supervisor.exit_code() or Exit.OK


def effective(rig: config.ServiceConfig, arguments: argparse.Namespace) -> config.ServiceConfig:
    """The configuration, overridden by the command line.

    Raises:
        KeyNameError: the rig cannot be called so.
    """
    record = {"enabled": rig.record.enabled and not arguments.no_record}
    if arguments.out:
        record["directory"] = arguments.out.resolve()
    devices = rig.devices
    if arguments.seed is not None:
        devices = {
            name: device.model_copy(update={"uri": with_seed(device.uri, arguments.seed)})
            for name, device in devices.items()
        }
    changes = {
        "name": keys.check_name(rig.name if arguments.rig is None else arguments.rig),
        "devices": devices,
        "record": rig.record.model_copy(update=record),
    }
    return rig.model_copy(update=changes)


def with_seed(uri: str, seed: int) -> str:
    """The address of a simulated device with another seed; any other address as it is."""
    parts = urlsplit(uri)
    if parts.scheme != "simulated":
        return uri
    query = dict(parse_qsl(parts.query, keep_blank_values=True)) | {"seed": str(seed)}
    return urlunsplit(parts._replace(query=urlencode(query, safe=",")))


def children(rig: config.ServiceConfig, path: Path) -> list[Child]:
    """The processes of a rig whose effective configuration is in the file `path`; the recorder is to stop last."""
    trackers = [Child(f"track/{name}", ("track", str(path), name), 1) for name in rig.trackers]
    recorder = [Child("record", ("record", str(path)), 2)] if rig.record.enabled else []
    return [Child("capture", ("capture", str(path)), 0), *trackers, *recorder]


@contextmanager
def file(rig: config.ServiceConfig) -> Iterator[Path]:
    """A configuration as a temporary file that may be gone before the end."""
    descriptor, name = tempfile.mkstemp(prefix=f"{rig.name}-", suffix=".toml", text=True)
    with open(descriptor, "w", encoding="utf-8") as stream:
        stream.write(config.to_toml(rig))
    path = Path(name)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


def limits(rig: config.ServiceConfig) -> Limits:
    """Limits and timeouts of the configuration."""
    table = rig.run
    seconds = (table.restart_window_s, table.startup_timeout_s, table.stall_timeout_s, table.stop_timeout_s)
    return Limits(table.max_restarts, *(int(value * 1e9) for value in seconds))


def spawn(display: Display, path: Path, toml: str, component: str, arguments: Sequence[str]) -> Process:
    """Starts a child process; first writes its configuration again if the file at `path` is gone."""
    # A child may start again after weeks, and many systems clear old files out of their temporary folder.
    with suppress(FileExistsError), path.open("x", encoding="utf-8") as stream:
        stream.write(toml)
    return ChildProcess(component, arguments, partial(_pass_on, display))


def _pass_on(display: Display, component: str, line: str) -> None:
    # An error that ends a child is what this process will end with, and say once.
    if line and not line.startswith("abs-service: error: "):
        display.note(f"{component}: {line}")


def make_display(as_json: bool) -> Display:
    """JSON, the live table in a terminal, or plain lines elsewhere."""
    if as_json:
        return JsonDisplay(sys.stdout, sys.stderr)
    return TableDisplay(Console()) if sys.stdout.isatty() else PlainDisplay(sys.stdout, sys.stderr)


class _Notes(logging.Handler):
    def __init__(self, display: Display) -> None:
        super().__init__()
        self._display = display

    def emit(self, record: logging.LogRecord) -> None:
        self._display.note(self.format(record))


@contextmanager
def _logging_to(display: Display) -> Iterator[None]:
    """Log records as notes of the display, because lines written past it would tear a table apart."""
    root = logging.getLogger()
    before = root.handlers[:]
    root.handlers[:] = [_Notes(display)]
    try:
        yield
    finally:
        root.handlers[:] = before

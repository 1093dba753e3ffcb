"""Common parts of the processes of a rig: arguments, bus session, signals."""

import argparse
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from types import FrameType

from abs_service import config
from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import TlsError
from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.commands.parts import library_output
from abs_service.supervision import gc_tuning
from abs_service.wire.checked_bus import CheckedBus


class SecurityError(Exception):
    """A file of `[bus.tls]` that cannot be used; the message names the rig file, key, value and error."""


def add_config(parser: argparse.ArgumentParser, what: str = "TOML file of the rig") -> None:
    """Adds CONFIG, which is `what`."""
    parser.add_argument(
        "config", metavar="CONFIG", nargs="?", type=Path, help=f"{what} (default: the simulated demo rig)"
    )


def add_arguments(parser: argparse.ArgumentParser, what: str = "TOML file of the rig") -> None:
    """Adds CONFIG, which is `what`, --connect and --listen."""
    add_config(parser, what)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--connect", metavar="ENDPOINT", help="connect to this endpoint instead of bus.endpoint")
    where.add_argument("--listen", metavar="ENDPOINT", help="let the others connect here, instead of connecting")


def load_config(arguments: argparse.Namespace) -> config.ServiceConfig:
    """The configuration that the arguments name.

    Raises:
        ConfigError: it cannot be used.
    """
    return config.load(arguments.config) if arguments.config else config.load_default()


def open_bus(
    rig: config.ServiceConfig, arguments: argparse.Namespace, *names: str
) -> AbstractContextManager[CheckedBus]:
    """The bus that the configuration and the arguments describe.

    Args:
        rig: the configuration.
        arguments: the arguments.
        names: that its certificate may have beside `rig`, see `roles`.

    Raises:
        BusError: it cannot be opened.
        SecurityError: a file of `[bus.tls]` cannot be used.
    """
    role = Role.ROUTER if arguments.listen else Role.CLIENT
    return open_bus_at(arguments.listen or arguments.connect or rig.bus.endpoint, role, rig, arguments, *names)


@contextmanager
def open_bus_at(
    endpoint: str, role: Role, rig: config.ServiceConfig, arguments: argparse.Namespace, *names: str
) -> Iterator[CheckedBus]:
    """`open_bus` at a given endpoint, in a given role."""
    gc_tuning.shorten_switch_interval()
    # Zenoh says on standard output which clients it refuses.
    with library_output.logged() if role is Role.ROUTER and rig.bus.tls else nullcontext():
        try:
            security = rig.bus.security(*names, roles.RIG)
            bus = ZenohBus.open(rig.name, endpoint, role, rig.bus.shared_memory, security, rig.bus.routers)
        except TlsError as error:
            raise SecurityError(f"{arguments.config or 'demo.toml'}: {error}") from None
        with CheckedBus(bus, time.monotonic_ns) as checked:
            yield checked


def stop_on_signals() -> threading.Event:
    """An event that SIGTERM, SIGINT and SIGHUP set. A second SIGTERM or SIGINT ends the process on the spot.

    SIGHUP says that the terminal is gone, often twice: by the kernel and by the shell. `nohup` lets it be ignored.
    """
    stop, told = threading.Event(), threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        if told.is_set():
            os._exit(128 + number)
        told.set()
        stop.set()

    signal.signal(signal.SIGTERM, on_signal)
    signal.signal(signal.SIGINT, on_signal)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda number, frame: stop.set())
    return stop

"""Common parts of the processes of a rig: arguments, bus session, signals."""

import argparse
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from queue import SimpleQueue
from types import FrameType

from abs_service import config
from abs_service.bus.security import roles
from abs_service.bus.security.expiry import Expiry
from abs_service.bus.security.mutual_tls import TlsError
from abs_service.bus.session import ENDPOINT_KEY, SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.commands.parts.log import library_output, logs
from abs_service.commands.parts.options import number
from abs_service.supervision.process_setup import process_tuning
from abs_service.wire.checked_bus import CheckedBus

#: Least time between two calls by SIGHUP [s].
HANGUP_PERIOD_S = 1.0
#: What longer times are taken for, which the interpreter could not wait for [s]: thirty years.
MAX_DURATION_S = 1e9


class SecurityError(Exception):
    """A file of `[bus.tls]` that cannot be used; the message names the rig file, key, value and error."""


def seconds(text: str) -> float:
    """Type of an argument: a time of 0 or more, cut at `MAX_DURATION_S` [s]."""
    return min(number(0.0, math.inf, "a number of seconds, 0 or more")(text), MAX_DURATION_S)


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


@contextmanager
def open_bus(rig: config.ServiceConfig, arguments: argparse.Namespace, *names: str) -> Iterator[CheckedBus]:
    """The bus that the configuration and the arguments describe; within it, the log is written in the background.

    Args:
        rig: the configuration.
        arguments: the arguments.
        names: that its certificate may have beside `rig`, see `roles`.

    Raises:
        BusError: it cannot be opened.
        SecurityError: a file of `[bus.tls]` cannot be used.
    """
    mode, endpoint, key = SessionMode.CLIENT, rig.bus.endpoint, ENDPOINT_KEY
    if arguments.connect is not None:
        endpoint, key = arguments.connect, "--connect"
    elif arguments.listen is not None:
        mode, endpoint, key = SessionMode.ROUTER, arguments.listen, "--listen"
    with logs.in_background(), open_bus_at(endpoint, mode, rig, arguments, *names, key=key) as bus:
        yield bus


@contextmanager
def open_bus_at(
    endpoint: str,
    mode: SessionMode,
    rig: config.ServiceConfig,
    arguments: argparse.Namespace,
    *names: str,
    key: str = ENDPOINT_KEY,
) -> Iterator[CheckedBus]:
    """`open_bus` at a given endpoint, in a given mode; `key` as in `open_session`."""
    process_tuning.shorten_switch_interval()
    # Zenoh says on standard output which clients it refuses.
    with library_output.logged() if mode is SessionMode.ROUTER and rig.bus.tls else nullcontext():
        try:
            security = rig.bus.security(*names, roles.RIG)
            bus = ZenohBus.open(rig.name, endpoint, mode, rig.bus.shared_memory, security, rig.bus.routers, key)
            expiry = Expiry(security, endpoint, mode is SessionMode.ROUTER, time.monotonic_ns)
        except TlsError as error:
            raise SecurityError(f"{config.named(arguments.config)}: {error}") from None
        with CheckedBus(bus, time.monotonic_ns, expiry.trouble) as checked:
            yield checked


def stop_on_signals() -> threading.Event:
    """An event that SIGTERM, SIGINT and SIGHUP set. A second SIGTERM or SIGINT ends the process on the spot.

    SIGHUP says that the terminal is gone, often twice: by the kernel and by the shell. `nohup` lets it be ignored.
    SIGUSR1 and SIGUSR2, by which others rotate their logs, do nothing here, but would end the process.
    """
    stop, is_signalled = threading.Event(), False
    hand_over = _in_thread(stop.set)

    def on_signal(number: int, frame: FrameType | None) -> None:
        nonlocal is_signalled
        if is_signalled:
            os._exit(128 + number)
        is_signalled = True
        hand_over(number, frame)

    signal.signal(signal.SIGTERM, on_signal)
    signal.signal(signal.SIGINT, on_signal)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, hand_over)
    for user_signal in (signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(user_signal, signal.SIG_IGN)
    return stop


def on_hangup(act: Callable[[], object], stop: threading.Event) -> None:
    """Lets SIGHUP call a function, from a thread and once for all that have arrived, in a process without a terminal.

    There it customarily asks a service to read its configuration again, and says nothing of a terminal. When `stop`
    is set, it has no effect any more.
    """

    def unless_it_ends() -> None:
        if not stop.is_set():
            act()
            stop.wait(HANGUP_PERIOD_S)

    try:
        os.close(os.open("/dev/tty", os.O_RDONLY))
    except OSError:
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signal.signal(signal.SIGHUP, _in_thread(unless_it_ends))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGHUP,))  # one that has come since the start waits for this


def _in_thread(act: Callable[[], object]) -> Callable[[int, FrameType | None], None]:
    """A handler of signals that calls a function from a thread: one that waits for a lock may hold it itself."""
    arrived: SimpleQueue[int] = SimpleQueue()

    def follow() -> None:
        while True:
            arrived.get()
            while not arrived.empty():
                arrived.get()
            act()

    threading.Thread(target=follow, name="signals", daemon=True).start()
    return lambda number, frame: arrived.put(number)

"""Common parts of the client's programs: arguments that name a rig, an end by signal, complaints."""

import argparse
import signal
import sys
import threading
from pathlib import Path

from abs_client.connection.link import DEFAULT_ENDPOINT, Link
from abs_client.connection.tls import Tls
from abs_client.estimates import states
from abs_client.rig import MAX_AGE_S

#: Exit status for what the user can mend.
USER_ERROR = 2


def add_rig(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments that `link` needs, and the largest age of estimates."""
    parser.add_argument("--endpoint", default=DEFAULT_ENDPOINT, help="bus.endpoint of the rig [%(default)s]")
    parser.add_argument("--rig", default="demo", help="its name [%(default)s]")
    parser.add_argument(
        "--maximum-age", type=_age, default=MAX_AGE_S, metavar="S", help="of estimates, in seconds [%(default)s]"
    )
    parser.add_argument(
        "--tls", type=Path, nargs=3, metavar=("AUTHORITY", "CERTIFICATE", "KEY"), help="for a rig with [bus.tls]"
    )


def link(given: argparse.Namespace) -> Link:
    """The connection that the arguments name; errors as in `Link`."""
    return Link(given.endpoint, given.rig, Tls(*given.tls) if given.tls else None)


def end_signal() -> threading.Event:
    """Set by Ctrl-C or SIGTERM."""
    end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: end.set())
    return end


def complain(reason: object) -> int:
    """Prints the reason of an error; returns its exit status."""
    print(reason, file=sys.stderr)
    return USER_ERROR


def _age(text: str) -> float:
    try:
        return states.checked_age(float(text))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no age: a number of seconds greater than 0") from None

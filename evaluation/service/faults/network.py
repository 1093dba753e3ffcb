"""A network of hosts: network namespaces at a bridge, on cables that may be slow and lossy."""

import fcntl
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from evaluation.experiment import UnavailableError
from evaluation.service.faults import slow_cables

#: Names begin so, that no interface of the machine is touched.
_PREFIX = "absf"
CAMERAS, TRACKING = f"{_PREFIX}-cameras", f"{_PREFIX}-track"
#: Hosts of a rig that is spread further; ROUTER is the first host of its network.
ROUTER, COLORS, READER = f"{_PREFIX}-router", f"{_PREFIX}-colors", f"{_PREFIX}-reader"
#: The first host of a network, where the others find who listens.
ADDRESS = "10.213.7.1"


@contextmanager
def two_hosts() -> Iterator[None]:
    """Creates the hosts `CAMERAS` and `TRACKING`, linked to each other and to this one, and removes them afterwards.

    Raises:
        UnavailableError: the user or the kernel does not permit it; says what was refused.
    """
    with linked(CAMERAS, TRACKING):
        yield


@contextmanager
def linked(first: str, *others: str, delay_s: float = 0.0, loss: float = 0.0) -> Iterator[None]:
    """Creates hosts, linked to each other and to this one, and removes them afterwards.

    Args:
        first: host with `ADDRESS`.
        others: hosts with the next addresses.
        delay_s, loss: of the cables of `others`, in each direction; see `slow_cables.laid`.

    Raises:
        UnavailableError: see `two_hosts`.
    """
    slow = others if delay_s or loss else ()
    with ExitStack() as stack:
        stack.enter_context(_alone())
        _remove(first, *others)  # what a run has left that was killed
        stack.callback(_remove, first, *others)
        _ip(f"link add {_PREFIX} type bridge")
        _ip(f"addr add 10.213.7.254/24 dev {_PREFIX}")
        _ip(f"link set {_PREFIX} up")
        if slow and (refused := stack.enter_context(slow_cables.laid(slow, delay_s, loss))):
            raise UnavailableError(refused)
        for number, host in enumerate((first, *others), 1):
            if host not in slow:
                _ip(f"link add {host} type veth peer name {host}-1")
            _ip(f"netns add {host}")
            _ip(f"link set {host}-1 netns {host} name eth0")
            _ip(f"link set {host} master {_PREFIX} up")
            _ip(f"-n {host} addr add 10.213.7.{number}/24 dev eth0")
            _ip(f"-n {host} link set eth0 up")
            _ip(f"-n {host} link set lo up")
        yield


def connect(host: str, connected: bool) -> None:
    """Plugs a host's cable in, or out."""
    _ip(f"link set {host} {'up' if connected else 'down'}")


@contextmanager
def _alone() -> Iterator[None]:
    """Waits for the networks of other runs on this machine, whose names are the same, to be gone."""
    try:
        lock = (Path(tempfile.gettempdir()) / f"{_PREFIX}.lock").open("w", encoding="utf-8")
    except PermissionError as error:
        raise UnavailableError(str(error)) from error
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _remove(*hosts: str) -> None:
    for words in (f"{kind} del {host}" for kind in ("link", "netns") for host in hosts):
        subprocess.run(["ip", *words.split()], capture_output=True, check=False)
    subprocess.run(["ip", "link", "del", _PREFIX], capture_output=True, check=False)


def _ip(words: str) -> None:
    try:
        subprocess.run(["ip", *words.split()], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise UnavailableError("there is no ip(8)") from error
    except subprocess.CalledProcessError as error:
        raise UnavailableError(f"ip {words}: {error.stderr.strip()}") from error

"""A network of two hosts: network namespaces at a bridge. Delay and loss would need tc-netem(8)."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from evaluation.experiment import UnavailableError

#: Names begin so, that no interface of the machine is touched.
_PREFIX = "absf"
CAMERAS, TRACKING = f"{_PREFIX}-cameras", f"{_PREFIX}-track"
#: Where the cameras' host listens.
ADDRESS = "10.213.7.1"


@contextmanager
def two_hosts() -> Iterator[None]:
    """`CAMERAS` and `TRACKING` exist, linked to each other and to this host; afterwards nothing is left of them.

    Raises:
        UnavailableError: the user or the kernel does not permit it; says what was refused.
    """
    try:
        _ip(f"link add {_PREFIX} type bridge")
        _ip(f"addr add 10.213.7.254/24 dev {_PREFIX}")
        _ip(f"link set {_PREFIX} up")
        for number, host in enumerate((CAMERAS, TRACKING), 1):
            _ip(f"netns add {host}")
            _ip(f"link add {host} type veth peer name eth0 netns {host}")
            _ip(f"link set {host} master {_PREFIX} up")
            _ip(f"-n {host} addr add 10.213.7.{number}/24 dev eth0")
            _ip(f"-n {host} link set eth0 up")
            _ip(f"-n {host} link set lo up")
        yield
    finally:
        for words in (f"link del {CAMERAS}", f"link del {TRACKING}", f"netns del {CAMERAS}", f"netns del {TRACKING}"):
            subprocess.run(["ip", *words.split()], capture_output=True, check=False)
        subprocess.run(["ip", "link", "del", _PREFIX], capture_output=True, check=False)


def connect(host: str, connected: bool) -> None:
    """Plugs a host's cable in, or out."""
    _ip(f"link set {host} {'up' if connected else 'down'}")


def _ip(words: str) -> None:
    try:
        subprocess.run(["ip", *words.split()], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise UnavailableError("there is no ip(8)") from error
    except subprocess.CalledProcessError as error:
        raise UnavailableError(f"ip {words}: {error.stderr.strip()}") from error

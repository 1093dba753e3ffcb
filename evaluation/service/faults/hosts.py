"""Faults of hosts and clocks: capture, tracker and recorder are processes of their own, as on several hosts.

A host is a time namespace (time_namespaces(7)), which has a monotonic clock of its own, and so another identity.
"""

import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import MappingProxyType

from evaluation.experiment import UnavailableError
from evaluation.service.faults import network
from evaluation.service.faults.fault import Elsewhere, Fault, Made
from evaluation.service.faults.processes import TRACKS_S
from evaluation.service.faults.running import START_S, RunningRig, table
from evaluation.service.live.rig import TRACKER, endpoint_of
from evaluation.service.live.service import ServiceError

#: Time that the cameras' host, which the others connect to, is away [s].
AWAY_S = 5.0
#: Time for which the network is cut [s].
CUT_S = 10.0
#: Clock of the cameras' host, ahead of that of the others; grows with each boot [s].
AHEAD_S = 2000


#: Those that send health.
COMPONENTS = frozenset({"capture", f"track/{TRACKER}", "record"})


class Hosts:
    """`capture --listen` on one host, `track --connect` and `record --connect` on others.

    Args:
        rig: file of the rig.
        networks: network namespace of a process, by its command; without one, it is that of this process.
    """

    def __init__(self, rig: Path, networks: Mapping[str, str] = MappingProxyType({})) -> None:
        self._networks = networks
        self._rig, self._endpoint = rig, endpoint_of(rig)
        self._boots = 0
        self._clocks: list[int] = []
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self.boot()
        await_port(self._endpoint)
        for command in ("track", "record"):
            self._running[command] = self._start(command, "--connect", self._endpoint)

    def boot(self) -> None:
        """Starts the cameras' host, whose clock is another one than before."""
        self._boots += 1
        clock = ["unshare", "--time", "--monotonic", str(AHEAD_S * self._boots)]
        self._running["capture"] = self._start("capture", "--listen", self._endpoint, before=clock)

    def power_off(self) -> None:
        """Kills what runs on the cameras' host."""
        # Held, or the kernel may give the number of this clock, a part of its identity, to the next one.
        self._clocks.append(os.open(f"/proc/{self._running['capture'].pid}/ns/time", os.O_RDONLY))
        self._running["capture"].kill()

    def processes(self) -> Mapping[str, int]:
        """See `running.Processes`."""
        return {name: one.pid for name, one in self._running.items()}

    def check(self) -> None:
        """See `running.Processes`."""
        for name in ("track", "record"):
            if (code := self._running[name].poll()) is not None:
                raise ServiceError(f"{name} ended by itself with code {code}")

    def stop(self, timeout_s: float = 15.0, number: signal.Signals = signal.SIGINT) -> int:
        """See `running.Processes`."""
        while self._clocks:
            os.close(self._clocks.pop())
        codes = [0]
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(number)
        for process in self._running.values():
            try:
                codes.append(process.wait(timeout_s))
            except subprocess.TimeoutExpired:
                process.kill()
                codes.append(process.wait())
        return max(map(abs, codes))

    def _start(self, command: str, *options: str, before: Sequence[str] = ()) -> subprocess.Popen[bytes]:
        log = (self._rig.parent / "output.jsonl").open("ab")
        inside = ["ip", "netns", "exec", self._networks[command]] if command in self._networks else []
        words = [*inside, *before, sys.executable, "-m", "abs_service", command, str(self._rig), *options]
        with log:
            return subprocess.Popen(words, stdout=log, stderr=log)


def await_port(endpoint: str) -> None:
    """Waits until a program listens."""
    host, _, port = endpoint.rpartition("/")[2].rpartition(":")
    deadline_s = time.monotonic() + START_S
    while True:
        with socket.socket() as probe:
            if probe.connect_ex((host, int(port))) == 0 or time.monotonic() > deadline_s:
                return
        time.sleep(0.05)


def _check_time_namespaces() -> None:
    refused = subprocess.run(["unshare", "--time", "true"], capture_output=True, text=True, check=False)
    if refused.returncode:
        raise UnavailableError(f"unshare --time: {refused.stderr.strip()}")


@contextmanager
def start_hosts(folder: Path, device: str, _: int) -> Iterator[RunningRig]:
    """See `fault.Fault.start`.

    Raises:
        UnavailableError: this user may not make time namespaces.
    """
    _check_time_namespaces()
    with RunningRig(folder, table(device), Hosts, COMPONENTS) as rig:
        yield rig


@contextmanager
def start_networked_hosts(folder: Path, device: str, _: int) -> Iterator[RunningRig]:
    """Starts hosts with a network between cameras and recorder on one side and the tracker on the other.

    Raises:
        UnavailableError: this user may make neither network namespaces nor time namespaces.
    """
    _check_time_namespaces()
    rig = table(device)
    rig["bus"]["endpoint"] = f"tcp/{network.ADDRESS}:7447"
    networks = {"capture": network.CAMERAS, "record": network.CAMERAS, "track": network.TRACKING}
    start = partial(Hosts, networks=networks)
    with network.two_hosts(), RunningRig(folder, rig, start, COMPONENTS) as running:
        yield running


def rebooted(rig: RunningRig) -> Made:
    """The cameras' host, which the others connect to, goes away and boots.

    Raises:
        TypeError: it is not a rig of several hosts.
    """
    if not isinstance(rig.service, Hosts):
        raise TypeError("a rig of `start_hosts` is needed")
    begin_ns = rig.now_ns()
    rig.service.power_off()
    time.sleep(AWAY_S)
    rig.service.boot()
    return Made(begin_ns, rig.now_ns())


def router_stopped(rig: RunningRig) -> Made:
    """The router stands still for longer than the lease of its clients."""
    begin_ns = rig.signal("capture", signal.SIGSTOP)
    time.sleep(AWAY_S)
    return Made(begin_ns, rig.signal("capture", signal.SIGCONT))


def cut(rig: RunningRig) -> Made:
    """The tracker's host has no network for a while."""
    begin_ns = rig.now_ns()
    network.connect(network.TRACKING, connected=False)
    try:
        time.sleep(CUT_S)
    finally:
        network.connect(network.TRACKING, connected=True)
    return Made(begin_ns, rig.now_ns())


_AWAY = f"tracks within {TRACKS_S:g} s when it is back; the others live on (away for {AWAY_S:g} s)"

FAULTS = (
    Fault(
        "the cameras' host reboots: new clock, new boot identity",
        _AWAY,
        rebooted,
        estimates_s=math.inf,
        recording_s=math.inf,
        tracks_s=TRACKS_S,
        noticed_s=math.inf,  # health itself goes through the router
        restarted=frozenset({"capture"}),
        start=start_hosts,
    ),
    Fault(
        "the router stands still for longer than the lease",
        _AWAY,
        router_stopped,
        estimates_s=math.inf,
        recording_s=math.inf,
        tracks_s=TRACKS_S,
        noticed_s=math.inf,  # likewise
        start=start_hosts,
    ),
    Fault(
        f"the network to the tracker's host is cut for {CUT_S:g} s",
        f"recording goes on; tracks within {TRACKS_S:g} s when it is back",
        cut,
        estimates_s=math.inf,
        tracks_s=TRACKS_S,
        noticed_s=math.inf,
        start=start_networked_hosts,
    ),
    Elsewhere(
        "the wall clock jumps by hours",
        "pairing and ages use the monotonic clock; the step is counted",
        "tests/abs_service/bus/test_stamps.py",
    ),
)

"""A rig on five hosts, over mutual TLS: network namespaces on slow cables, and clocks of their own."""

import base64
import json
import os
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from abs_service import cli
from abs_service.bus.contract import Sample
from drivers.contract.host_clock import host_clock
from evaluation.service.faults import network
from evaluation.service.faults.hosts import await_port
from evaluation.service.live.rig import demo_table
from tests.system.running import Received, RigListener

ENDPOINT = f"tls/{network.ADDRESS}:7447"
#: Of each cable but the router's, in each direction. A query from tracker to cameras passes four: 80 ms.
DELAY_S, LOSS = 0.02, 0.02
#: Of the reference: half a period is twice the largest error of both cameras' clocks.
RATE_HZ = 3.0
#: Simulations begin when they like, so that one of colour is always near only at twice the rate.
RATES_HZ = {"tof": RATE_HZ, "color": 2 * RATE_HZ}
HOUR_NS = 3600 * 10**9
PROGRAM = Path(__file__).with_name("another_host.py")


@dataclass(frozen=True)
class Clock:
    """A host's clock: ahead of that of this host, and since a moment of it faster."""

    ahead_ns: int
    ppm: float
    begin_ns: int

    def here_ns(self, t_ns):
        """A time of it on the clock of this host."""
        gain = self.ppm * 1e-6
        return (t_ns - self.ahead_ns + self.begin_ns * gain) / (1 + gain)


class FarListener(RigListener):
    """A listener on another host."""

    def __init__(self):
        self.received = []
        self._thread = threading.Thread(target=self._take_lines, daemon=True)

    def follow(self, lines):
        """Takes what is written there, until it ends."""
        self._lines = lines
        self._thread.start()

    def close(self):
        """Waits for the end."""
        self._thread.join()

    def _take_lines(self):
        with self._lines:
            for line in self._lines:
                t_ns, topic, message, payload, attachment = json.loads(line)
                sample = Sample(topic, message, base64.b64decode(payload), base64.b64decode(attachment))
                self.received.append(Received(t_ns, sample))


class FarHosts:
    """Starts what runs on the hosts of `network.linked`; a context manager that kills it.

    Attributes:
        clocks: every clock that there was, by its name on the wire.
        log: what all of them wrote.
    """

    def __init__(self, folder):
        self._folder, self._stack = folder, ExitStack()
        self.clocks, self.running = {}, {}
        self.log = folder / "log"
        assert cli.main(["keys", str(folder / "keys"), "--host", network.ADDRESS]) == 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stack.close()

    def rig(self, name, *sensors):
        """A rig file of the host whose certificate is `name`; with one sensor, nothing is tracked."""
        rig = demo_table("demo")
        uri = f"simulated://sheet?seed=1&speed=0&rate={RATES_HZ[sensors[0]]:g}&sensors={','.join(sensors)}"
        sizes = {"tof": "&tof=88x72", "color": "&color=80x60"}
        rig["devices"]["sim"]["uri"] = uri + "".join(sizes[sensor] for sensor in sensors)
        files = {"authority": "authority.pem", "certificate": f"{name}.pem", "key": f"{name}.key"}
        rig["bus"] = {"endpoint": ENDPOINT, "tls": {key: f"keys/{file}" for key, file in files.items()}}
        rig["sensors"] = {sensor: rig["sensors"][sensor] for sensor in sensors}
        rig["record"] |= {"minimum_free_bytes": 0}
        rig["synchronisation"]["tolerance_ms"] = 300 / RATE_HZ
        if len(sensors) == 1:
            del rig["trackers"], rig["synchronisation"]
        path = self._folder / f"{'-'.join((name, *sensors))}.toml"
        path.write_text(tomli_w.dumps(rig), encoding="utf-8")
        return str(path)

    def start(self):
        """Starts everything, the listener first of those that connect."""
        every = ("tof", "color")
        self._start(network.ROUTER, "-m", "abs_service", "record", self.rig("rig", *every), "--listen", ENDPOINT)
        await_port(ENDPOINT)
        keys = self._folder / "keys"
        files = f"connect_certificate_file={keys}/viewer.pem;connect_private_key_file={keys}/viewer.key"
        viewer = f"{ENDPOINT}#enable_mtls=true;root_ca_certificate_file={keys}/authority.pem;{files}"
        listener = self._stack.enter_context(FarListener())
        listener.follow(self._start(network.READER, PROGRAM, "read", viewer, stdout=subprocess.PIPE).stdout)
        self.boot(network.CAMERAS, "tof", HOUR_NS, 100)
        self.boot(network.COLORS, "color", 2 * HOUR_NS, -100)
        self._start(network.TRACKING, "-m", "abs_service", "track", self.rig("tracker", *every), "sheet")
        return listener

    def boot(self, host, sensor, ahead_ns, ppm):
        """Starts the capture of a host, whose clock is another one than ever before."""
        begin_ns = time.monotonic_ns()
        before = ("unshare", "--time", "--monotonic", str(ahead_ns // 10**9))
        rig = self.rig("capture", sensor)
        process = self._start(host, PROGRAM, "drift", ppm, begin_ns + ahead_ns, "capture", rig, before=before)
        while os.path.samefile(own := f"/proc/{process.pid}/ns/time", "/proc/self/ns/time"):
            time.sleep(0.01)
        # Held, or the kernel may give the number of this clock, a part of its name, to the next one.
        self._stack.callback(os.close, os.open(own, os.O_RDONLY))
        name = f"{host_clock().rpartition('-')[0]}-{os.stat(own).st_ino}"
        self.clocks[name] = Clock(ahead_ns, ppm, begin_ns)
        return name

    def power_off(self, host):
        """A host goes away without a word."""
        network.connect(host, connected=False)
        self.running[host].kill()
        self.running[host].wait()

    def _start(self, host, *words, before=(), **settings):
        log = self._stack.enter_context(self.log.open("ab"))
        command = ["ip", "netns", "exec", host, *before, sys.executable, *map(str, words)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        process = subprocess.Popen(command, stderr=log, env=environment, **({"stdout": log} | settings))
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        self.running[host] = process
        return process

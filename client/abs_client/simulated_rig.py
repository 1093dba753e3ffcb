"""A simulated rig in processes of its own: a sheet of paper that bends in front of two cameras, for tests."""

import importlib.util
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from urllib.parse import urlencode

from abs_client.errors import ClientError, UnreachableError
from abs_client.estimates.state import State, Status
from abs_client.rig import subscribe
from abs_client.stream import Stream

#: By when it must track: the first start on a machine compiles the numerical code [s].
START_S = 240.0
#: By when it must have ended after it was asked to [s].
STOP_S = 15.0
#: Pause between two attempts to reach it [s].
PAUSE_S = 0.2

_FILE = """\
version = 1
name = "{name}"

[bus]
endpoint = "{endpoint}"

[devices.sim]
uri = "simulated://sheet?{address}"

[sensors.tof]
device = "sim"

[sensors.tof.noise]
type = "gaussian_polynomial"
sigma = [[1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14], [5.0e-4, 0.0, 0.0, 0.0]]
amplitudes = [400.0, 10000.0]

[sensors.color]
device = "sim"
noise = {{ type = "color", sigma = 4.0 }}

[synchronisation]
reference = "tof/depth"

[trackers.sheet]
sensors = ["tof", "color"]
budget_ms = {budget_ms:.1f}

[trackers.sheet.model]
type = "nurbs"
"""


class RigFailedError(ClientError):
    """The service ended or did not track in time; the message holds its output."""


@dataclass(frozen=True)
class SimulatedRig:
    """A rig whose images are the same for the same settings.

    Which of them its tracker is in time for depends on the host.

    Attributes:
        seed: of motion, texture and noise.
        rate: exposures per second; the tracker gets 72 % of the time between two.
        speed: factor on the speed of all motion: `rate=60` with `speed=2` has the images of 30 and 1 twice as fast,
            from the fifth second on; the rest before the motion and the times of `turn` and `leave` are not shorter.
        fault: what goes wrong and from which exposure on, such as `stall@90`, as the simulator calls it
            (docs/reference/simulation.md).
        keys: further keys of the simulator's address: `{"occluder": "hand"}`.
        name: of the rig; its tracker is `sheet`, its sensors are `tof` and `color`.
        service: command that starts the service; `{folder}` in it is that of the rig's file. "": the installed one.
    """

    seed: int = 1
    rate: float = 30.0
    speed: float = 1.0
    fault: str = ""
    keys: Mapping[str, str] = field(default_factory=dict)
    name: str = "demo"
    service: str = ""

    def file(self, endpoint: str) -> str:
        """The rig's file."""
        address = {"seed": self.seed, "rate": self.rate, "speed": self.speed, **self.keys}
        if self.fault:
            address["fault"] = self.fault
        budget_ms = 720.0 / self.rate
        return _FILE.format(
            name=self.name, endpoint=endpoint, address=urlencode(address, safe="@,"), budget_ms=budget_ms
        )


@dataclass(frozen=True)
class RunningRig:
    """A rig that runs.

    Attributes:
        endpoint: where it listens.
        name, tracker: names for `subscribe`.
        process: of the service.
    """

    endpoint: str
    name: str
    tracker: str
    process: subprocess.Popen

    def states(self, maximum_age_s: float = 0.5) -> Stream[State]:
        """The estimates of its tracker."""
        return subscribe(self.endpoint, self.name, self.tracker, maximum_age_s)


@contextmanager
def run_rig(settings: SimulatedRig = SimulatedRig()) -> Iterator[RunningRig]:
    """Starts a simulated rig, waits until it tracks, and ends it.

    Raises:
        RigFailedError: the service is not installed, ended, or did not track within `START_S`.
    """
    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    with tempfile.TemporaryDirectory(prefix="abs_rig_") as folder, (Path(folder) / "log").open("w+b") as log:
        file = Path(folder) / "rig.toml"
        file.write_text(settings.file(endpoint), encoding="utf-8")
        command = [*_service(settings.service, folder), "run", str(file), "--no-record", "--json"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log)
        rig = RunningRig(endpoint, settings.name, "sheet", process)
        try:
            _wait_until_it_tracks(rig, Path(log.name))
            yield rig
        finally:
            _end(process)


def _service(command: str, folder: str) -> list[str]:
    if command:
        return [part.replace("{folder}", folder) for part in shlex.split(command)]
    if importlib.util.find_spec("abs_service") is not None:
        return [sys.executable, "-m", "abs_service"]
    if elsewhere := shutil.which("abs-service"):
        return [elsewhere]
    raise RigFailedError(
        "abs-service is installed neither beside abs-service-client nor on PATH, and no command is given"
    )


def _wait_until_it_tracks(rig: RunningRig, log: Path) -> None:
    end_s = monotonic() + START_S
    while monotonic() < end_s:
        if rig.process.poll() is not None:
            break
        try:
            with rig.states(PAUSE_S) as states:
                for state in states:
                    if state.status is Status.TRACKING:
                        return
                    if rig.process.poll() is not None or monotonic() > end_s:
                        break
        except UnreachableError:
            continue
    said = log.read_text(encoding="utf-8", errors="replace")[-4000:]
    status = rig.process.poll()
    ended = f"did not track within {START_S:g} s" if status is None else f"ended with exit code {status}"
    raise RigFailedError(f"the simulated rig {ended}:\n{said}")


def _end(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])

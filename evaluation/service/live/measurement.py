"""One run of the service, watched from outside, and what was seen."""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.bus import keys
from evaluation.experiment import UnavailableError
from evaluation.service.live import proc, recording
from evaluation.service.live.listener import Arrival, Listener, counted
from evaluation.service.live.rig import NAME, STREAMS, TRACKER, endpoint_of, write_rig
from evaluation.service.live.service import Service

#: The first start on a machine compiles the kernels [s].
PATIENCE_S = 180.0
#: What an hour or a minute writes to disk depends on the noise only: it cannot be compressed [bytes/s].
RECORDED_BYTES_S = 35_000_000


@dataclass(frozen=True, slots=True)
class Start:
    """How long a user waits for the first estimate, and for the first that says TRACKING [s]."""

    first_s: float
    tracking_s: float


@dataclass(frozen=True, slots=True)
class Watched:
    """One run, watched from when it had settled to its end.

    Attributes:
        start: how it began.
        arrivals: the estimates of exposures within the time that was watched, as they arrived.
        begin_ns, end_ns: of that time, CLOCK_MONOTONIC [ns].
        counted_before: what each component had counted when that time began, by component.
        counted: what it counted until that time was over.
        times_s: moments of the usages (n,), from `begin_ns` [s].
        usages: what each process had used at those moments, by command.
        machine: what all processors had done at those moments.
        recorded: numbers of the messages that the recording holds, by topic.
        recorded_bytes: size of the recording.
        exit_code: of the service.
    """

    start: Start
    arrivals: tuple[Arrival, ...]
    begin_ns: int
    end_ns: int
    counted_before: Mapping[str, Mapping[str, int]]
    counted: Mapping[str, Mapping[str, int]]
    times_s: NDArray[np.float64]
    usages: Mapping[str, tuple[proc.Usage, ...]]
    machine: tuple[proc.Machine, ...]
    recorded: Mapping[str, frozenset[int]]
    recorded_bytes: int
    exit_code: int


def help_s(times: int) -> tuple[float, ...]:
    """How long `abs-service --help` takes, each time in a fresh process [s]."""
    took: list[float] = []
    for _ in range(times):
        begin_s = time.perf_counter()
        subprocess.run([sys.executable, "-m", "abs_service", "--help"], check=True, capture_output=True)
        took.append(time.perf_counter() - begin_s)
    return tuple(took)


def started(seed: int) -> Start:
    """Starts the service, waits until it tracks and ends it."""
    with _running(seed, 0.0) as (service, listener, _):
        return _await_tracking(service, listener)


def watched(seed: int, settle_s: float, duration_s: float, sample_s: float, progress: Callable[[str], None]) -> Watched:
    """Runs the service and watches it.

    Args:
        seed: of the simulated motion and noise.
        settle_s: time after the first TRACKING that is not watched [s].
        duration_s: time that is watched [s].
        sample_s: time between two looks at the processes [s].
        progress: told how far it is.

    Raises:
        UnavailableError: the disk has no room for the recording.
        ServiceError: the service ended by itself.
    """
    with _running(seed, settle_s + duration_s) as (service, listener, takes):
        start = _await_tracking(service, listener)
        time.sleep(settle_s)
        begin_ns = time.monotonic_ns()
        times_s, usages, machine = _sample(service, duration_s, sample_s, progress)
        end_ns = time.monotonic_ns()
        time.sleep(1.5)  # until every component has said once more how it is
        exit_code = service.stop()
        arrivals = tuple(one for one in listener.arrivals if begin_ns <= one.exposed_ns < end_ns)
        before, all_ = (
            {name: counted(said, t_ns) for name, said in listener.health.items()} for t_ns in (begin_ns, end_ns)
        )
        progress("reading the recording")
        recorded = recording.numbers(takes, [*(keys.image(*stream) for stream in STREAMS), keys.state(TRACKER)])
        size = sum(path.stat().st_size for path in takes.iterdir())
    return Watched(start, arrivals, begin_ns, end_ns, before, all_, times_s, usages, machine, recorded, size, exit_code)


def _sample(
    service: Service, duration_s: float, sample_s: float, progress: Callable[[str], None]
) -> tuple[NDArray[np.float64], Mapping[str, tuple[proc.Usage, ...]], tuple[proc.Machine, ...]]:
    """Looks at everything every `sample_s` from now on: moments (n,) from now [s], usages by command, the machine."""
    processes = service.processes()
    begin_s = time.monotonic()
    times_s: list[float] = []
    rows: list[dict[str, proc.Usage]] = []
    machine: list[proc.Machine] = []
    while not times_s or times_s[-1] < duration_s:
        service.check()
        time.sleep(max(0.0, begin_s + len(times_s) * sample_s - time.monotonic()))
        times_s.append(time.monotonic() - begin_s)
        rows.append({name: proc.usage(pid) for name, pid in processes.items()})
        machine.append(proc.machine())
        if len(times_s) % max(1, round(10 / sample_s)) == 0:
            progress(f"watched for {times_s[-1]:.0f} s of {duration_s:.0f} s")
    return np.array(times_s), {name: tuple(row[name] for row in rows) for name in processes}, tuple(machine)


def _await_tracking(service: Service, listener: Listener) -> Start:
    deadline_s = time.monotonic() + PATIENCE_S
    while not (tracking := [one for one in listener.arrivals if one.is_tracking]):
        service.check()
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"nothing was tracked within {PATIENCE_S:.0f} s of the start")
        time.sleep(0.02)
    first_ns, tracking_ns = listener.arrivals[0].t_ns, tracking[0].t_ns
    return Start((first_ns - service.started_ns) * 1e-9, (tracking_ns - service.started_ns) * 1e-9)


@contextmanager
def _running(seed: int, duration_s: float) -> Iterator[tuple[Service, Listener, Path]]:
    """The service, somebody who listens, and the folder of the recordings; everything is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="abs-live-") as name:
        folder = Path(name)
        needed, free = round(duration_s * RECORDED_BYTES_S), shutil.disk_usage(folder).free
        if needed > free:
            raise UnavailableError(
                f"{folder.parent}: {free / 1e9:.1f} GB are free, the recording needs {needed / 1e9:.1f} GB; make room, "
                "or name another folder for temporary files with TMPDIR"
            )
        rig = write_rig(folder, seed)
        with Service(rig) as service, Listener(endpoint_of(rig), NAME, TRACKER) as listener:
            yield service, listener, folder / "takes"

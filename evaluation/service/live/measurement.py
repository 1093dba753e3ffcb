"""One run of the service, observed from outside."""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from abs_service.bus import keys
from evaluation.experiment import UnavailableError
from evaluation.service.live import proc, recording
from evaluation.service.live.rig import NAME, STREAMS, TRACKER, endpoint_of, write_rig
from evaluation.service.live.service import Service
from evaluation.service.live.subscriber import ReceivedEstimate, Subscriber, counted

#: The first start on a machine compiles the kernels [s].
START_TIMEOUT_S = 180.0
#: Numba's environment variable for the folder of its cache.
CACHE = "NUMBA_CACHE_DIR"
#: Data rate of the recording, which is noise and cannot be compressed [bytes/s].
RECORDED_BYTES_S = 35_000_000


@dataclass(frozen=True, slots=True)
class StartTimes:
    """Time from the start to the first estimate, and to the first with status TRACKING [s]."""

    first_s: float
    tracking_s: float


@dataclass(frozen=True, slots=True)
class ObservedRun:
    """One run, observed from the end of its settling time on.

    Attributes:
        start: how it began.
        arrivals: received estimates of the exposures within the observed time.
        begin_ns, end_ns: observed time, CLOCK_MONOTONIC [ns].
        counted_before: counters at its beginning, by component.
        counted: counters at its end, by component.
        times_s: moments of the usages (n,), from `begin_ns` [s].
        usages: CPU time and memory of each process at those times, by command.
        machine: CPU times of the machine at those times.
        recorded: sequence numbers of the recorded messages, by topic.
        recorded_bytes: size of the recording.
        exit_code: of the service.
    """

    start: StartTimes
    arrivals: tuple[ReceivedEstimate, ...]
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
    """Duration of `abs-service --help` [s], each time in a new process."""
    took: list[float] = []
    for _ in range(times):
        begin_s = time.perf_counter()
        subprocess.run([sys.executable, "-m", "abs_service", "--help"], check=True, capture_output=True)
        took.append(time.perf_counter() - begin_s)
    return tuple(took)


def started(seed: int) -> StartTimes:
    """Starts the service, waits until it tracks and ends it."""
    with _running(seed, 0.0) as (service, subscriber, _):
        return _await_tracking(service, subscriber)


def started_cold(seed: int) -> StartTimes:
    """The same with an empty cache of kernels, as at the first start on a machine."""
    with tempfile.TemporaryDirectory(prefix="abs-cache-") as cache, _running(seed, 0.0, {CACHE: cache}) as running:
        service, subscriber, _ = running
        return _await_tracking(service, subscriber)


def watched(
    seed: int, settle_s: float, duration_s: float, sample_s: float, progress: Callable[[str], None]
) -> ObservedRun:
    """Runs the service and observes it.

    Args:
        seed: of the simulated motion and noise.
        settle_s: time after the first TRACKING that is not observed [s].
        duration_s: observed time [s].
        sample_s: sampling interval of CPU time and memory [s].
        progress: called with the current step.

    Raises:
        UnavailableError: the disk has no room for the recording.
        ServiceError: the service ended by itself.
    """
    with _running(seed, settle_s + duration_s) as (service, subscriber, takes):
        start = _await_tracking(service, subscriber)
        time.sleep(settle_s)
        begin_ns = time.monotonic_ns()
        times_s, usages, machine = _sample(service, duration_s, sample_s, progress)
        end_ns = time.monotonic_ns()
        time.sleep(1.5)  # until every component has published its health once more
        exit_code = service.stop()
        arrivals = tuple(one for one in subscriber.arrivals if begin_ns <= one.exposed_ns < end_ns)
        before, all_ = (
            {name: counted(said, t_ns) for name, said in subscriber.health.items()} for t_ns in (begin_ns, end_ns)
        )
        progress("reading the recording")
        recorded = recording.sequence_numbers(
            takes, [*(keys.image(*stream) for stream in STREAMS), keys.state(TRACKER)]
        )
        size = sum(path.stat().st_size for path in takes.iterdir())
    return ObservedRun(
        start, arrivals, begin_ns, end_ns, before, all_, times_s, usages, machine, recorded, size, exit_code
    )


def _sample(
    service: Service, duration_s: float, sample_s: float, progress: Callable[[str], None]
) -> tuple[NDArray[np.float64], Mapping[str, tuple[proc.Usage, ...]], tuple[proc.Machine, ...]]:
    """Samples every `sample_s` from now on: times (n,) from now [s], usages by command, the machine."""
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


def _await_tracking(service: Service, subscriber: Subscriber) -> StartTimes:
    deadline_s = time.monotonic() + START_TIMEOUT_S
    while not (tracking := [one for one in subscriber.arrivals if one.is_tracking]):
        service.check()
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"nothing was tracked within {START_TIMEOUT_S:.0f} s of the start")
        time.sleep(0.02)
    first_ns, tracking_ns = subscriber.arrivals[0].t_ns, tracking[0].t_ns
    return StartTimes((first_ns - service.started_ns) * 1e-9, (tracking_ns - service.started_ns) * 1e-9)


@contextmanager
def _running(
    seed: int, duration_s: float, environment: Mapping[str, str] = MappingProxyType({})
) -> Iterator[tuple[Service, Subscriber, Path]]:
    """The running service, a subscriber, and the folder of the recordings; all are removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="abs-live-") as name:
        folder = Path(name)
        needed, free = round(duration_s * RECORDED_BYTES_S), shutil.disk_usage(folder).free
        if needed > free:
            raise UnavailableError(
                f"{folder.parent}: {free / 1e9:.1f} GB are free, the recording needs {needed / 1e9:.1f} GB; make room, "
                "or name another folder for temporary files with TMPDIR"
            )
        rig = write_rig(folder, seed)
        with Service(rig, environment) as service, Subscriber(endpoint_of(rig), NAME, TRACKER) as subscriber:
            yield service, subscriber, folder / "takes"

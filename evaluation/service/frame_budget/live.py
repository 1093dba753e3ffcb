"""The service with a recording as its live device, recording on, observed from outside."""

import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.service.frame_budget import errors
from evaluation.service.frame_budget.errors import TrackedFrame
from evaluation.service.frame_budget.rig import NAME, RATE_HZ, TRACKER, configuration, replayed
from evaluation.service.live import proc
from evaluation.service.live.losses import loss_counters
from evaluation.service.live.rig import endpoint_of
from evaluation.service.live.service import Service
from evaluation.service.live.subscriber import ReceivedEstimate, Subscriber, counted

#: Time that the processes have to get ready, kernels in the cache, and to settle once frames come [s].
START_S, SETTLE_S = 20.0, 3.0

#: How much later than the first frames the first estimate may be, and the recording still be long enough [s].
LATE_S = 10.0

#: Time until every component has published its health once more [s].
HEALTH_S = 1.5

#: A program that keeps a core busy.
_BUSY = "while True: pass"


@dataclass(frozen=True, slots=True)
class Run:
    """A way to run the service on a recording.

    Attributes:
        name: what it is called in tables.
        duration_s: observed time [s].
        speed: of the recording.
        cameras: number of devices that play it.
        trackers: number of equal trackers.
        busy: number of other programs that keep a core busy each.
    """

    name: str
    duration_s: float
    speed: float = 1.0
    cameras: int = 1
    trackers: int = 1
    busy: int = 0

    @property
    def rate_hz(self) -> float:
        """Exposures per second."""
        return RATE_HZ * self.speed

    @property
    def exposures(self) -> int:
        """Exposures that the recording has to have."""
        return round((self.duration_s + SETTLE_S + LATE_S) * self.rate_hz) if self.duration_s else 0


@dataclass(frozen=True, slots=True)
class Observed:
    """Estimates, losses and CPU time of a run.

    Attributes:
        ages_ms: at publication (n,) [ms].
        rate_hz: estimates per second.
        skipped: frame sets passed over.
        lost: exposures of the reference that are in no estimate.
        counted: losses that the components counted.
        tracking: share of the estimates that are TRACKING.
        cores: CPU time per time, by process; of all trackers together.
        frames: estimates of the first tracker by exposure, the observed time and what was before and after.
    """

    ages_ms: NDArray[np.float64]
    rate_hz: float
    skipped: int
    lost: int
    counted: int
    tracking: float
    cores: Mapping[str, float]
    frames: Mapping[int, TrackedFrame]

    @property
    def age_ms(self) -> tuple[float, float]:
        """Median and 99th percentile of the ages at publication [ms]; NaN without estimates."""
        p50, p99 = np.percentile(self.ages_ms, (50, 99)) if len(self.ages_ms) else (np.nan, np.nan)
        return float(p50), float(p99)

    @property
    def all_cores(self) -> float:
        """CPU time per time of all processes."""
        return sum(self.cores.values())

    @property
    def silent(self) -> int:
        """Exposures that are in no estimate and that nobody counted."""
        return max(0, self.lost - self.counted)


def observe(take: Path, head: str, run: Run, progress: Callable[[str], None]) -> Observed:
    """Runs the service on a recording and observes it for a while.

    Args:
        take: the recording, of at least `run.exposures`.
        head: the depth head in it.
        run: how.
        progress: called with the current step.

    Raises:
        ServiceError: the service ended by itself.
    """
    with tempfile.TemporaryDirectory(prefix="abs-budget-") as name:
        rig = Path(name) / "rig.toml"
        uris = [replayed(take, START_S, run.speed)] * run.cameras
        rig.write_text(configuration(head, uris, run.trackers), encoding="utf-8")
        with Service(rig) as service, Subscriber(endpoint_of(rig), NAME, TRACKER) as subscriber:
            while not subscriber.arrivals:
                service.check()
                time.sleep(0.02)
            progress(f"{run.name}: observes for {run.duration_s:.0f} s")
            with _busy(run.busy):
                time.sleep(SETTLE_S)
                begin_ns, cores = time.monotonic_ns(), _cores(service, run.duration_s)
                service.check()
            end_ns = time.monotonic_ns()
            time.sleep(HEALTH_S)
            seen = [one for one in subscriber.arrivals if begin_ns <= one.t_ns < end_ns]
            lost = _counted(subscriber, end_ns) - _counted(subscriber, begin_ns)
        return _observed(seen, head, cores, sum(lost.values()), errors.recorded(rig.parent / "takes", head))


@contextmanager
def _busy(programs: int) -> Iterator[None]:
    """Load of other programs that do not rest."""
    with ExitStack() as stack:
        for _ in range(programs):
            busy = stack.enter_context(subprocess.Popen([sys.executable, "-c", _BUSY]))
            stack.callback(busy.kill)
        yield


def _cores(service: Service, duration_s: float) -> Mapping[str, float]:
    """CPU time per time by command, from now on; NaN if one of its processes ended meanwhile."""
    processes, begin_s = service.every_process(), time.monotonic()
    before = {pid: _cpu_s(pid) for _, pid in processes}
    time.sleep(duration_s)
    took_s = time.monotonic() - begin_s
    cores: dict[str, float] = {}
    for command, pid in processes:
        cores[command] = cores.get(command, 0.0) + (_cpu_s(pid) - before[pid]) / took_s
    return cores


def _cpu_s(pid: int) -> float:
    try:
        return proc.usage(pid).cpu_s
    except OSError:
        return np.nan


def _counted(subscriber: Subscriber, until_ns: int) -> Counter[str]:
    return loss_counters({name: counted(said, until_ns) for name, said in subscriber.health.items()})


def _observed(
    seen: Sequence[ReceivedEstimate],
    head: str,
    cores: Mapping[str, float],
    losses: int,
    frames: Mapping[int, TrackedFrame],
) -> Observed:
    numbers = [one.sensors[head] for one in seen if head in one.sensors]
    return Observed(
        np.array([one.age_ms for one in seen]),
        (len(seen) - 1) / (seen[-1].t_ns - seen[0].t_ns) * 1e9 if len(seen) > 1 else 0.0,
        sum(one.skipped for one in seen),
        len(set(range(numbers[0], numbers[-1] + 1)).difference(numbers)) if numbers else 0,
        losses,
        float(np.mean([one.is_tracking for one in seen])) if seen else 0.0,
        cores,
        frames,
    )

"""The service with the recording as its live device, recording on, observed from outside."""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.service.frame_budget.rig import NAME, TRACKER, configuration, replayed
from evaluation.service.live import proc
from evaluation.service.live.rig import endpoint_of
from evaluation.service.live.service import Service
from evaluation.service.live.subscriber import ReceivedEstimate, Subscriber

#: Time that the processes have to get ready, kernels in the cache, and to settle once frames come [s].
START_S, SETTLE_S = 20.0, 3.0


@dataclass(frozen=True, slots=True)
class Observed:
    """Estimates and CPU time of a run.

    Attributes:
        ages_ms: at publication (n,) [ms].
        skipped: frame sets passed over.
        lost: exposures of the reference that are in no estimate.
        tracking: share of the estimates that are TRACKING.
        cores: CPU time per time, by process.
    """

    ages_ms: NDArray[np.float64]
    skipped: int
    lost: int
    tracking: float
    cores: dict[str, float]


def observe(take: Path, head: str, duration_s: float, progress: Callable[[str], None]) -> Observed:
    """Runs the service on a recording and observes it for a while.

    Args:
        take: the recording, longer than that by `SETTLE_S`.
        head: the depth head in it.
        duration_s: observed time [s].
        progress: called with the current step.

    Raises:
        ServiceError: the service ended by itself.
    """
    with tempfile.TemporaryDirectory(prefix="abs-budget-") as name:
        rig = Path(name) / "rig.toml"
        rig.write_text(configuration(head, replayed(take, START_S)), encoding="utf-8")
        with Service(rig) as service, Subscriber(endpoint_of(rig), NAME, TRACKER) as subscriber:
            while not subscriber.arrivals:
                service.check()
                time.sleep(0.02)
            progress(f"observes for {duration_s:.0f} s")
            time.sleep(SETTLE_S)
            processes, begin_ns = service.processes(), time.monotonic_ns()
            before = {one: proc.usage(pid).cpu_s for one, pid in processes.items()}
            time.sleep(duration_s)
            took_s = (time.monotonic_ns() - begin_ns) * 1e-9
            cores = {one: (proc.usage(pid).cpu_s - before[one]) / took_s for one, pid in processes.items()}
            seen = [one for one in subscriber.arrivals if one.t_ns >= begin_ns]
    return _observed(seen, head, cores)


def _observed(seen: list[ReceivedEstimate], head: str, cores: dict[str, float]) -> Observed:
    numbers = [one.sensors[head] for one in seen if head in one.sensors]
    return Observed(
        np.array([one.age_ms for one in seen]),
        sum(one.skipped for one in seen),
        len(set(range(numbers[0], numbers[-1] + 1)).difference(numbers)) if numbers else 0,
        float(np.mean([one.is_tracking for one in seen])) if seen else 0.0,
        cores,
    )

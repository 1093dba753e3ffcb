"""Times of the frames of a case, in one pass."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from abs_service.tracking.session import TrackingSession
from calib import jit
from evaluation.method.rates.cases import Case
from evaluation.method.rates.clocked import Watched
from evaluation.sequences import UntrackedError, demo_plan, demo_rig, expose, simulate

#: The first exposure that is timed, the sheet moves by then; exposures on the way there, from the flat sheet at rest.
FIRST, APPROACH = 90, range(0, 90, 3)


@dataclass(frozen=True, slots=True)
class Times:
    """Times of single frames, from frame set to estimate.

    Attributes:
        clock_ms, clock_p95_ms: median and 95th percentile by the clock [ms].
        cpu_ms, cpu_p95_ms: the same of the processor time of the tracker's thread [ms].
        search_share: of the search without costs and derivatives, median over the frames.
    """

    clock_ms: float
    clock_p95_ms: float
    cpu_ms: float
    cpu_p95_ms: float
    search_share: float


def measure(case: Case, frames: int) -> Times:
    """Tracks the moving sheet, frame after frame.

    Raises:
        UntrackedError: no object was detected.
    """
    simulation = simulate("simulated://sheet?seed=1")
    rig = demo_rig(simulation)
    rig = replace(rig, sensors={name: rig.sensors[name] for name in case.sensors})
    watched = Watched(case.optimizer)
    plan = demo_plan(case.model, optimizer=watched, vertices=case.vertices, evaluations=10**9)
    session, took_s, worked_s = TrackingSession(rig, plan), [], []
    for exposure in expose(simulation, (*APPROACH, *range(FIRST, FIRST + frames))):
        began, begin = time.thread_time(), time.perf_counter()
        session.track(exposure.frames, lambda: True)
        took_s.append(time.perf_counter() - begin)
        worked_s.append(time.thread_time() - began)
    if session.mesh is None:
        raise UntrackedError(f"{case.part}: nothing was found")
    clock_ms, cpu_ms = (1e3 * np.array(one[-frames:]) for one in (took_s, worked_s))
    return Times(
        float(np.median(clock_ms)),
        float(np.quantile(clock_ms, 0.95)),
        float(np.median(cpu_ms)),
        float(np.quantile(cpu_ms, 0.95)),
        float(np.median(1e3 * np.array(watched.took_s[-frames:]) / cpu_ms)),
    )


def measured(threads: int, frames: int, scale: float) -> Mapping[str, Times]:
    """Times of all cases by part, from a process of its own: the number of threads is that of a process."""
    command = [sys.executable, "-m", "evaluation.method.rates", str(frames), str(scale)]
    environment = os.environ | {jit.THREADS: str(threads)}
    printed = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    found: dict[str, dict[str, Any]] = json.loads(printed)
    return {part: Times(**times) for part, times in found.items()}

"""Figures of each estimate that the page keeps for a minute, and what was lost until then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health
from numpy.typing import NDArray

#: Time that numbers are kept [s].
MINUTE_S = 60.0

#: First parts of the counters that count losses.
LOSSES = frozenset({"dropped", "lost", "malformed", "refused", "skipped", "unused"})


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Numbers of one estimate.

    Attributes:
        t_s: arrival [s].
        age_ms, solve_ms: age, and time of the search [ms].
        generations, skipped: effort, and frame sets passed over.
        likelihoods: log-likelihood of a vertex by sensor.
        deviation_mm: σ of a vertex, median over the mesh [mm]; NaN if it is unknown.
        model_id: theta is comparable between equal ones.
        theta: parameters (d,) of the model.
        lost: what each component has lost until then, by name.
    """

    t_s: float
    age_ms: float
    solve_ms: float
    generations: int
    skipped: int
    likelihoods: dict[str, float]
    deviation_mm: float
    model_id: str
    theta: NDArray[np.float32]
    lost: Mapping[str, int]


def of_state(state: DeformationState, t_s: float, lost: Mapping[str, int]) -> Numbers:
    """Numbers of an estimate that came at `t_s` [s], when so much was lost by component."""
    likelihoods = {one.sensor: one.mean_log_likelihood for one in state.sensors if not one.missing and one.samples}
    deviation_mm = 1e3 * state.deviation_m if state.covariance_valid else float("nan")
    theta = np.array(state.theta, np.float32)
    effort = state.age_ms, state.solve_ms, state.generations, state.skipped
    return Numbers(t_s, *effort, likelihoods, deviation_mm, state.model_id, theta, lost)


def rate_hz(numbers: Sequence[Numbers], now_s: float, seconds: float = 3.0) -> float:
    """Estimates per second in the last seconds, or after the first one if that came later."""
    times_s = [one.t_s for one in numbers if one.t_s > now_s - seconds]
    if len(times_s) < len(numbers):
        return len(times_s) / seconds
    return (len(times_s) - 1) / (now_s - times_s[0]) if times_s and times_s[0] < now_s else 0.0


def losses(health: Health) -> int:
    """Images, frame sets and messages that a component has lost since it began, of all causes."""
    return sum(number for name, number in health.counters.items() if name.partition(".")[0] in LOSSES)

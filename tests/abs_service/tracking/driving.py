"""A simulated device's exposures straight into a tracking, without processes, clocks or files."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from abs_service import config, wiring
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.optimizers import cma_es
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracking.log.truth import Errors
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import Plan, make_posterior
from abs_service.tracking.session import TrackingSession
from calib.rig import Rig
from drivers.contract.frame import Frame, FrameSet
from drivers.simulated import address
from drivers.simulated.simulation import Simulation
from evaluation.sequences import SMALL, TruthEvaluator

CONFIG = config.load_default()
TRACKER = next(iter(CONFIG.trackers))


def default_plan(**changes: object) -> Plan:
    """The default rig's plan with few control points, which are tracked sooner, and some parts exchanged."""
    return dataclasses.replace(wiring.plan(CONFIG, TRACKER), **{"model": SMALL, **changes})


def rig_of(simulation: Simulation) -> Rig:
    """The default rig around a simulation's cameras."""
    return wiring.rig(CONFIG, TRACKER, {name: head.camera for name, head in simulation.heads.items()})


def simulate(uri: str) -> Simulation:
    """The simulation of an address."""
    return address.parse(uri).build()


def frame_set(frames: list[Frame], seq: int) -> FrameSet:
    """Frames of one exposure."""
    return FrameSet(seq, frames[0].t_host_ns, {frame.key: frame for frame in frames})


@dataclass(frozen=True)
class Step:
    """An estimate, and how far it is from the truth where that is known."""

    estimate: Estimate
    errors: Errors | None


def drive(
    tracking: TrackingSession,
    simulation: Simulation,
    exposures: Iterable[int],
    change: Callable[[int, list[Frame]], list[Frame]] = lambda k, frames: frames,
    in_time: Callable[[], bool] = lambda: True,
) -> Iterator[Step]:
    """Tracks exposures; `change` alters the frames of an exposure before the tracker sees them."""
    evaluator = TruthEvaluator(tracking)
    for k in exposures:
        frames, truth = simulation.expose(k)
        estimate = tracking.track(frame_set(change(k, frames), k), in_time)
        yield Step(estimate, evaluator.errors(estimate, truth.points_r))


def mean_errors(steps: list[Step]) -> tuple[float, float]:
    """Mean vertex and surface error [mm] of the steps with a known error."""
    errors = [step.errors for step in steps if step.errors is not None]
    return float(np.mean([e.vertex_mm for e in errors])), float(np.mean([e.surface_mm for e in errors]))


def tracked_error_mm(uri: str, exposures: Iterable[int], **changes: object) -> float:
    """Mean vertex error [mm] of the paper's search in exposures of an address, all of which say TRACKING.

    Args:
        uri: of the simulated device.
        exposures: their numbers.
        changes: parts of the plan.
    """
    simulation = simulate(uri)
    plan = default_plan(optimizer=cma_es.Settings(), **changes)
    steps = list(drive(TrackingSession(rig_of(simulation), plan), simulation, exposures))
    vertex_mm, surface_mm = mean_errors(steps)
    print(f"{uri} {changes}: vertex {vertex_mm:.2f} mm, surface {surface_mm:.2f} mm")
    assert {step.estimate.status for step in steps} == {Status.TRACKING}
    return vertex_mm


def posterior_of(model: DeformationModel, rig: Rig, frames: list[Frame]) -> Posterior:
    """Likelihood and priors of a model that has observed the frames of one exposure."""
    observation = Observer(rig).observe(frame_set(frames, 0))
    return make_posterior(default_plan(), rig, model, observation)[0]


def frame_posterior_of(model: DeformationModel, rig: Rig, first: list[Frame], second: list[Frame]) -> FramePosterior:
    """The posterior of a second exposure, without a motion before it, of a model that has observed a first one."""
    posterior, observation = posterior_of(model, rig, first), Observer(rig).observe(frame_set(second, 1))
    return posterior.observe(observation, posterior.motion.predict(observation.t_host_ns))

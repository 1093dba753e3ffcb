"""Simulated sequences with known truth, tracked offline and without a clock."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service import config, wiring
from abs_service.pairing.images import DepthImage
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracking.log.truth import Errors, TruthComparison
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import ModelSettings, Plan
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.tracked_sets import track_sets
from calib.noise.base import DepthNoise, pixels_where
from calib.rig import Noise, Rig
from drivers.contract.frame import FrameSet
from drivers.simulated.address import parse
from drivers.simulated.simulation import Simulation
from evaluation.scenes.exposure import LabeledExposure

#: The Euclidean fitness clamps differences of distances to this value [m]. The published fitness has no bound; this one
#: is above all errors here, and keeps the cost finite when the object is lost.
CUTOFF_M = 0.1

#: The likelihood of the pixels alone. The outline, which it has by default, is left out where it is compared with the
#: Euclidean fitness, which has none, as the paper had none: what is compared is what it is worth to know σ and μ.
PIXELS_ALONE = likelihood.Settings(outline_px=0.0)

#: Model of the experiments that ask for no other: 48 numbers in Θ, about as many as the paper's. A user's default has
#: more control points (`nurbs.Settings()`).
SMALL = nurbs.Settings((4, 4), 2)

#: First exposure in which simulated sheets move; before, they rest in their initial pose.
FIRST_MOVING = 40


class UntrackedError(RuntimeError):
    """Sequence in whose first exposure no object is detected, or whose truth is unknown."""


def expose(simulation: Simulation, indices: Iterable[int]) -> list[LabeledExposure]:
    """Exposures of a simulated device at the given indices, with their truth."""
    exposures = []
    for k in indices:
        frames, truth = simulation.expose(k)
        images = FrameSet(k, truth.t_host_ns, {frame.key: frame for frame in frames})
        exposures.append(LabeledExposure(images, truth.points_r.astype(np.float64)))
    return exposures


def moving_indices(frames: int, stride: int) -> list[int]:
    """Indices of exposures of a simulated sheet: 0, at rest, then `frames` of its motion at intervals of `stride`."""
    return [0, *range(FIRST_MOVING, FIRST_MOVING + stride * frames, stride)]


def simulate(address: str) -> Simulation:
    """The simulation of an address."""
    return parse(address).build()


def demo_rig(simulation: Simulation) -> Rig:
    """The demo rig with the cameras of a simulation; sensors that the simulation lacks are left out."""
    settings = config.load_default()
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    rig = wiring.rig(settings, next(iter(settings.trackers)), cameras)
    return replace(rig, sensors={name: rig.sensors[name] for name in simulation.heads})


def with_noise(rig: Rig, sensor: str, noise: Noise) -> Rig:
    """The rig with another noise model of one sensor."""
    return replace(rig, sensors={**rig.sensors, sensor: replace(rig.sensors[sensor], noise=noise)})


def demo_plan(model: ModelSettings = SMALL, **changes: object) -> Plan:
    """Plan of the demo rig's tracker with another model, and other parts replaced."""
    settings = config.load_default()
    plan = wiring.plan(settings, next(iter(settings.trackers)))
    return replace(plan, model=model, **changes)


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """Result of tracking a sequence.

    Attributes:
        models: of the estimates; it changes when a lost object is detected again.
        estimates: of all exposures.
        errors: of all estimates.
        material: true positions of the vertices' material points (n, 3) [m], of all exposures.
        cpu_ms: CPU time of all exposures [ms].
    """

    models: Sequence[DeformationModel]
    estimates: Sequence[Estimate]
    errors: Sequence[Errors]
    material: Sequence[NDArray[np.float64]]
    cpu_ms: Sequence[float]

    @cached_property
    def vertex_mm(self) -> float:
        """Mean vertex error [mm]."""
        return float(np.mean([error.vertex_mm for error in self.errors]))

    @cached_property
    def surface_mm(self) -> float:
        """Mean surface error [mm]."""
        return float(np.mean([error.surface_mm for error in self.errors]))

    @property
    def model(self) -> DeformationModel:
        """The last model."""
        return self.models[-1]

    @property
    def relocations(self) -> int:
        """Number of times a lost object was detected again; its vertices then have other material points."""
        return sum(one is not other for one, other in pairwise(self.models))

    @property
    def worst_mm(self) -> float:
        """Vertex error of the worst exposure [mm]."""
        return max(error.vertex_mm for error in self.errors)

    @property
    def tracked(self) -> float:
        """Share of the exposures that are TRACKING."""
        return float(np.mean([estimate.status == Status.TRACKING for estimate in self.estimates]))

    @property
    def median_ms(self) -> float:
        """Median CPU time of an exposure [ms], without the first, which includes initial detection."""
        return float(np.median(self.cpu_ms[1:]))

    @property
    def evaluations(self) -> float:
        """Mean number of candidates per exposure, without the first."""
        return float(np.mean([estimate.search.evaluations for estimate in self.estimates[1:]]))

    @property
    def thetas(self) -> NDArray[np.float64]:
        """Parameters (exposures, dim)."""
        return np.stack([estimate.theta for estimate in self.estimates])


class TruthEvaluator:
    """Compares the estimates of a tracking session with the truth.

    Args:
        session: the session. The caller tracks, so that the comparison is not part of the measured time.
    """

    def __init__(self, session: TrackingSession):
        self._session = session
        self._truths = TruthComparison()
        self._known = session.mesh_version

    def errors(self, estimate: Estimate, points: NDArray[np.floating]) -> Errors | None:
        """Errors of the session's latest estimate; None if the truth is unknown.

        Args:
            estimate: the latest.
            points: true positions of the surface's material points (rows, columns, 3) [m] at that time.
        """
        self._truths.add_truth(estimate.t_host_ns, points)
        if self._session.mesh is not None and self._session.mesh_version != self._known:
            self._known = self._session.mesh_version
            self._truths.add_topology(self._session.mesh.vertices, self._session.made_ns)
        return self._truths.compare(estimate.t_host_ns, estimate.vertices)

    def material_points(self, estimate: Estimate) -> NDArray[np.float64] | None:
        """True positions of the vertices' material points (n, 3) [m] at an evaluated estimate; None if unknown."""
        return self._truths.material_points(estimate.t_host_ns)


def effort(runs: Sequence[TrackedSequence]) -> dict[str, float]:
    """Cost and tracking share of several sequences, by name."""
    return {
        "worst_mm": max(one.worst_mm for one in runs),
        "evaluations": float(np.mean([one.evaluations for one in runs])),
        "median_ms": float(np.median([one.median_ms for one in runs])),
        "tracked": float(np.mean([one.tracked for one in runs])),
    }


def track(rig: Rig, plan: Plan, exposures: Sequence[LabeledExposure]) -> TrackedSequence:
    """Tracks a sequence.

    Raises:
        UntrackedError: no object is detected in the first exposure.
    """
    session = TrackingSession(rig, plan)
    evaluator = TruthEvaluator(session)
    models, estimates, errors, material, cpu_ms = [], [], [], [], []
    frame_sets = (exposure.frames for exposure in exposures)
    tracked = track_sets(session, frame_sets, time.process_time_ns)
    for exposure, (_, estimate, took_ns) in zip(exposures, tracked, strict=True):
        cpu_ms.append(took_ns * 1e-6)
        error, points = evaluator.errors(estimate, exposure.points), evaluator.material_points(estimate)
        if error is None or points is None or session.model is None:
            raise UntrackedError(f"exposure {exposure.frames.seq}: {', '.join(estimate.reasons)}")
        models.append(session.model)
        estimates.append(estimate)
        errors.append(error)
        material.append(points)
    return TrackedSequence(models, estimates, errors, material, cpu_ms)


def mean_deviation(rig: Rig, sensor: str, exposure: LabeledExposure, nearer_than: float) -> float:
    """Mean σ [m] over the pixels of a depth image nearer than `nearer_than` [m]: those of the object."""
    image, noise = Observer(rig).observe(exposure.frames).images[sensor], rig.sensors[sensor].noise
    if not (isinstance(image, DepthImage) and isinstance(noise, DepthNoise)):
        raise TypeError(f"{sensor} measures no distances")
    with np.errstate(invalid="ignore"):
        near = image.distance < nearer_than
    x, a = image.distance[near].astype(np.float64), image.amplitude[near].astype(np.float64)
    return float(np.mean(noise.deviation(x, a, pixels_where(near))))


def euclidean_fitness(deviation: float, levels: float = 4.0) -> euclidean.Settings:
    """Euclidean fitness with the weights of a likelihood whose standard deviations are the same for all pixels.

    The priors, which are the same for both, thus have the same relative weight.

    Args:
        deviation: of distances [m].
        levels: of colours [levels of 256].
    """
    return euclidean.Settings(depth_weight=0.5 / deviation**2, color_weight=0.5 / levels**2, cutoff_m=CUTOFF_M)

"""Sequences whose truth is known, and what a tracker makes of them, offline and without a clock."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service import config, wiring
from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observer
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives import euclidean
from abs_service.tracking.session import ModelSettings, Plan, Tracking
from abs_service.tracking.truth import Errors, TruthComparison
from calib.noise.base import DepthNoise, pixels_where
from calib.rig import Noise, Rig
from drivers.contract.frame import FrameSet
from drivers.simulated.address import parse
from drivers.simulated.simulation import Simulation
from evaluation.scenes.exposure import LabeledExposure

#: Euclidean fitness counts distances that differ by more like this much [m]. The published one has no such bound; this
#: one is above all errors here, and keeps a search that has lost the object finite.
CUTOFF_M = 0.1

#: The exposure from which on simulated sheets move: until then they rest where the mesh is made.
MOVING = 40


class UntrackedError(RuntimeError):
    """A sequence that does not begin with an object in sight, or whose truth is not known."""


def expose(simulation: Simulation, indices: Iterable[int]) -> list[LabeledExposure]:
    """Takes exposures of a simulated device."""
    exposures = []
    for k in indices:
        frames, truth = simulation.expose(k)
        images = FrameSet(k, truth.t_host_ns, {frame.key: frame for frame in frames})
        exposures.append(LabeledExposure(images, truth.points_r.astype(np.float64)))
    return exposures


def moving_indices(frames: int, every: int) -> list[int]:
    """Exposures of a simulated sheet: the first, in which nothing moves, and then `frames`, one in `every`."""
    return [0, *range(MOVING, MOVING + every * frames, every)]


def simulate(address: str) -> Simulation:
    """The simulation of an address."""
    return parse(address).build()


def demo_rig(simulation: Simulation) -> Rig:
    """The built-in rig around a simulation's cameras, with the sensors that the simulation has."""
    settings = config.load_default()
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    rig = wiring.rig(settings, next(iter(settings.trackers)), cameras)
    return replace(rig, sensors={name: rig.sensors[name] for name in simulation.heads})


def with_noise(rig: Rig, sensor: str, noise: Noise) -> Rig:
    """A rig that believes another noise model of one of its sensors."""
    return replace(rig, sensors={**rig.sensors, sensor: replace(rig.sensors[sensor], noise=noise)})


def demo_plan(model: ModelSettings, **changes: object) -> Plan:
    """The built-in rig's tracker with another model, and other parts exchanged."""
    settings = config.load_default()
    return replace(wiring.plan(settings, next(iter(settings.trackers))), model=model, **changes)


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """What a tracker made of a sequence.

    Attributes:
        models: that every estimate's parameters are those of; another one where a lost object was found again.
        estimates: of every exposure.
        errors: of every estimate.
        material: where the vertices' own material points (n, 3) really were [m], of every exposure.
        cpu_ms: processor time of every exposure [ms].
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
        """How often a lost object was found again: its vertices are then compared with other material points."""
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
        """Processor time of a exposure [ms], median; the first one, which may take longer, is left out."""
        return float(np.median(self.cpu_ms[1:]))

    @property
    def evaluations(self) -> float:
        """Mean number of candidates a exposure; the first one is left out."""
        return float(np.mean([estimate.evaluations for estimate in self.estimates[1:]]))

    @property
    def thetas(self) -> NDArray[np.float64]:
        """Parameters (exposures, dim)."""
        return np.stack([estimate.theta for estimate in self.estimates])


class TruthEvaluator:
    """Compares what a tracking finds with the truth.

    Args:
        tracking: the tracker. Whoever asks lets it track, so that nothing of the comparison counts as its time.
    """

    def __init__(self, tracking: Tracking):
        self._tracking = tracking
        self._truths = TruthComparison()
        self._known = tracking.mesh_version

    def errors(self, estimate: Estimate, points: NDArray[np.floating]) -> Errors | None:
        """How far the tracking's newest estimate is from the truth; None where that is unknown.

        Args:
            estimate: the newest.
            points: where the surface's material points (rows, columns, 3) really were [m] at its moment.
        """
        self._truths.add_truth(estimate.t_host_ns, points)
        if self._tracking.mesh is not None and self._tracking.mesh_version != self._known:
            self._known = self._tracking.mesh_version
            self._truths.add_topology(self._tracking.mesh.vertices, self._tracking.made_ns)
        return self._truths.compare(estimate.t_host_ns, estimate.vertices)

    def material_points(self, estimate: Estimate) -> NDArray[np.float64] | None:
        """Where the vertices' own material points (n, 3) really were [m] at a judged estimate; None where unknown."""
        return self._truths.material_points(estimate.t_host_ns)


def effort(runs: Sequence[TrackedSequence]) -> dict[str, float]:
    """What several sequences cost, and how well they held."""
    return {
        "worst_mm": max(one.worst_mm for one in runs),
        "evaluations": float(np.mean([one.evaluations for one in runs])),
        "median_ms": float(np.median([one.median_ms for one in runs])),
        "tracked": float(np.mean([one.tracked for one in runs])),
    }


def track(rig: Rig, plan: Plan, exposures: Sequence[LabeledExposure]) -> TrackedSequence:
    """Tracks a sequence.

    Raises:
        UntrackedError: no object is in sight in its first exposure.
    """
    tracking = Tracking(rig, plan)
    evaluator = TruthEvaluator(tracking)
    models, estimates, errors, material, cpu_ms = [], [], [], [], []
    for exposure in exposures:
        begun = time.process_time()
        estimate = tracking.track(exposure.frames, lambda: True)
        cpu_ms.append((time.process_time() - begun) * 1e3)
        error, points = evaluator.errors(estimate, exposure.points), evaluator.material_points(estimate)
        if error is None or points is None or tracking.model is None:
            raise UntrackedError(f"exposure {exposure.frames.seq}: {', '.join(estimate.reasons)}")
        models.append(tracking.model)
        estimates.append(estimate)
        errors.append(error)
        material.append(points)
    return TrackedSequence(models, estimates, errors, material, cpu_ms)


def mean_deviation(rig: Rig, sensor: str, exposure: LabeledExposure, nearer_than: float) -> float:
    """Mean σ [m] over the pixels of a depth sensor's image that are nearer than so many metres: those of the object."""
    image, noise = Observer(rig).observe(exposure.frames).images[sensor], rig.sensors[sensor].noise
    if not (isinstance(image, DepthImage) and isinstance(noise, DepthNoise)):
        raise TypeError(f"{sensor} measures no distances")
    with np.errstate(invalid="ignore"):
        near = image.distance < nearer_than
    x, a = image.distance[near].astype(np.float64), image.amplitude[near].astype(np.float64)
    return float(np.mean(noise.deviation(x, a, pixels_where(near))))


def euclidean_fitness(deviation: float, levels: float = 4.0) -> euclidean.Settings:
    """The Euclidean fitness that weighs like the likelihood of one deviation everywhere.

    So the priors, which are the same for both, count as much beside either.

    Args:
        deviation: of distances [m].
        levels: of colours, of 256.
    """
    return euclidean.Settings(depth_weight=0.5 / deviation**2, color_weight=0.5 / levels**2, cutoff_m=CUTOFF_M)

"""One tracker from its first frame set on: finds the object, makes the mesh and the model, then tracks."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from abs_service.pairing.image_decoders import kinds
from abs_service.pairing.observation import Observation, Observer
from abs_service.tracker import status
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, ModelError
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.optimizers.base import Optimizer, Stop
from abs_service.tracker.posterior import priors
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.posterior.priors import MotionPrior, ShapePrior
from abs_service.tracker.posterior.stretch_prior import StretchPrior
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.photometric.appearance import dressed
from abs_service.tracker.tracker import Tracker
from abs_service.tracking import loss_monitor
from abs_service.tracking.vertex_offsets import FixedOffsets, VertexOffsets
from abs_service.tracking.vertex_offsets import Settings as VertexOffsetSettings
from calib.rig import ImageNoise, Rig, Sensor
from drivers.contract.frame import FrameSet


class ModelSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.models`."""

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board before the sensor that `build` takes for its object."""
        ...

    def build(self, detection: InitialDetection) -> DeformationModel:
        """The model of an object as it is first seen."""
        ...


class ObjectiveSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.objectives`."""

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> Objective:
        """The objective of a mesh in a rig."""
        ...


class SynthesisSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.synthesis`."""

    def build(self, rig: Rig, mesh: Mesh) -> Synthesizer:
        """The synthesis of a mesh for the sensors of a rig."""
        ...


class OptimizerSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.optimizers`."""

    def build(self, dimension: int, generator: np.random.Generator) -> Optimizer:
        """A search that draws from `generator`."""
        ...


class RegionSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.detection.regions`."""

    def build(self) -> Region:
        """The region."""
        ...


@dataclass(frozen=True)
class Plan:
    """Everything that a tracker is made of.

    Attributes:
        reference: sensor whose depth image gives the initial mesh.
        model, region, synthesis, objective, optimizer: settings of the exchangeable parts.
        evaluations: how often a frame may compute the cost of a candidate.
        vertices: about how many vertices the mesh is to have.
        priors, status, reinitialization, vertex_offsets: settings of the fixed parts.
        seed: of the search's random numbers; equal seeds and frame sets give equal estimates.
    """

    reference: str
    model: ModelSettings
    region: RegionSettings
    synthesis: SynthesisSettings
    objective: ObjectiveSettings
    optimizer: OptimizerSettings
    evaluations: int
    vertices: int
    priors: priors.Settings
    status: status.Settings
    reinitialization: loss_monitor.Settings
    vertex_offsets: VertexOffsetSettings = field(default_factory=VertexOffsetSettings)
    seed: int = 0


class Tracking:
    """Turns frame sets of one rig into estimates.

    Attributes:
        mesh: the undeformed mesh; None until the object was found.
        mesh_version: counts the meshes made.
        made_ns: moment of the frames that the mesh was made from, CLOCK_MONOTONIC [ns].
    """

    def __init__(self, rig: Rig, plan: Plan):
        self.mesh: Mesh | None = None
        self.mesh_version = 0
        self.made_ns = 0
        self._rig = rig
        self._plan = plan
        self._region = plan.region.build()
        self._observer = Observer(rig)
        self._tracker: Tracker | None = None
        self._vertex_offsets: VertexOffsets = FixedOffsets()
        self._loss_monitor = loss_monitor.LossMonitor(plan.reinitialization)
        self._told = False
        self._unseen: frozenset[str] = frozenset()

    @property
    def model(self) -> DeformationModel | None:
        """What deforms the mesh; None until the object was found."""
        return None if self._tracker is None else self._tracker.model

    def track(self, frames: FrameSet, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for a frame set; the search goes on while `in_time` allows.

        Raises:
            ObservationError: the frames do not fit the rig.
        """
        return self.track_observation(self._observer.observe(frames), in_time)

    def track_observation(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for an observation, see `track`."""
        told, self._told = self._told, False
        notes: tuple[str, ...] = ()
        try:
            if self._tracker is None:
                self._adopt(*self._begin(observation), observation)
            elif (
                told
                or self._loss_monitor.attempt_due(observation.t_host_ns)
                or self._unseen.difference(observation.missing)
            ):
                self._look_again(self._tracker, told, observation)
        except (DetectionError, ModelError) as error:
            notes = (str(error),)
        if self._tracker is None:
            return _initializing(observation, notes)
        estimate = self._loss_monitor.with_hysteresis(self._tracker.track(observation, in_time))
        if estimate.status == Status.TRACKING:
            surface = self._tracker.model.deform(estimate.theta[None])
            self._vertex_offsets.update(observation.images.get(self._plan.reference), surface, observation.t_host_ns)
        reasons = estimate.reasons + tuple(f"looked for the object again: {note}" for note in notes)
        return estimate if estimate.status == Status.TRACKING else replace(estimate, reasons=reasons)

    def reinitialize(self) -> None:
        """Looks for the object anew in the next frame set, whatever the old one was; safe from any thread."""
        self._told = True

    def _look_again(self, tracker: Tracker, told: bool, observation: Observation) -> None:
        """Begins anew if the object is in sight; DetectionError or ModelError if it is not, or not the lost one."""
        if not told and self._loss_monitor.keeps_mesh(observation.t_host_ns):
            tracker.relocate(self._detect(observation).points)
            return
        lost = tracker.model.mesh
        begun, mesh = self._begin(observation)
        if not told and self._loss_monitor.differs_in_size(mesh, lost):
            raise DetectionError(f"what is in sight has {mesh.area * 1e4:.0f} cm², not {lost.area * 1e4:.0f} cm²")
        self._adopt(begun, mesh, observation)

    def _adopt(self, tracker: Tracker, mesh: Mesh, observation: Observation) -> None:
        self._tracker, self.mesh, self.made_ns = tracker, mesh, observation.t_host_ns
        self._vertex_offsets = self._plan.vertex_offsets.build(tracker.model, self._rig.sensors[self._plan.reference])
        # What these see of the surface is not known: as soon as one of them delivers, it is time to begin anew.
        sensors = self._rig.sensors
        self._unseen = frozenset(n for n in observation.missing if isinstance(sensors[n].noise, ImageNoise))
        self.mesh_version += 1

    def _detect(self, observation: Observation) -> InitialDetection:
        return detect_object(observation, self._rig, self._plan.reference, self._region, self._plan.vertices)

    def _begin(self, observation: Observation) -> tuple[Tracker, Mesh]:
        plan = self._plan
        model = plan.model.build(self._detect(observation))
        synthesizer = plan.synthesis.build(self._rig, model.mesh)
        mesh = replace(
            dressed(model.mesh, observation.images, self._rig),
            appearance=dressed(synthesizer.canvas, observation.images, self._rig).appearance,
        )
        posterior = Posterior(
            model,
            plan.objective.build(self._rig, mesh, synthesizer),
            StretchPrior(mesh, plan.priors.stretch),
            ShapePrior(model.rest, model.prior),
            MotionPrior(model.rest, model.scales, plan.priors),
        )
        optimizer = plan.optimizer.build(posterior.dimension, np.random.default_rng(plan.seed))
        tracker = Tracker(model, posterior, optimizer, plan.evaluations, plan.status)
        return tracker, mesh


def streams(sensors: Iterable[Sensor]) -> list[tuple[str, str]]:
    """The (head, stream) of every image that the sensors' noise models need; streams are called by their kind."""
    return list(dict.fromkeys((sensor.head, kind.value) for sensor in sensors for kind in kinds(sensor.noise)))


def _initializing(observation: Observation, reasons: tuple[str, ...]) -> Estimate:
    return Estimate(
        seq=observation.seq,
        t_host_ns=observation.t_host_ns,
        status=Status.INITIALIZING,
        reasons=reasons,
        theta=np.zeros(0),
        covariance=np.zeros((0, 0)),
        vertices=np.zeros((0, 3), np.float32),
        vertex_covariance=np.zeros((0, 3, 3)),
        cost=float("nan"),
        deviation=float("nan"),
        searcher="",
        stop=Stop.NOTHING,
        generations=0,
        evaluations=0,
        budget=0,
        inlier_share=0.0,
        fits=(),
        sources=observation.sources,
        missing=observation.missing,
    )

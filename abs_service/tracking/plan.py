"""The settings of one tracker's parts, and a tracker built from them on the first observation of its object."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from abs_service.pairing.observation import Observation
from abs_service.tracker import resolution
from abs_service.tracker.appearance import with_appearance
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.plausibility import ExtentError, warnings
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.templates import base as templates
from abs_service.tracker.detection.templates import first_image
from abs_service.tracker.detection.templates.base import ALL_SEEN, Sight, Template
from abs_service.tracker.estimates import status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, HasDerived, ModelError
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.optimizers.base import Optimizer
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.posterior.priors import settings as priors
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.places.patches import patches_of
from abs_service.tracker.tracker import Tracker
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.offsets.vertex_offsets import Settings as VertexOffsetSettings
from abs_service.tracking.offsets.vertex_offsets import VertexOffsets
from calib.noise.base import DepthNoise, ImageNoise
from calib.noise.scaled import Scaled
from calib.rig import Rig


class ModelSettings(templates.ModelSettings[DeformationModel], Protocol):
    """`Settings` of a module of `abs_service.tracker.models`."""

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which `build` can build a model; used by the warm-up."""
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
        """An optimiser that draws random numbers from `generator`."""
        ...


class RegionSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.detection.regions`."""

    def build(self) -> Region:
        """The region."""
        ...


class TemplateSettings(Protocol):
    """`Settings` of a module of `abs_service.tracker.detection.templates`."""

    def build(self, vertices: int) -> Template:
        """The template, for a mesh of about `vertices` vertices."""
        ...


@dataclass(frozen=True)
class Plan:
    """The settings of all parts of a tracker.

    Attributes:
        reference: sensor from whose depth image the initial mesh is built.
        model, region, synthesis, objective, optimizer: settings of the exchangeable parts.
        evaluations: maximum number of cost evaluations per frame.
        vertices: approximate number of vertices of the mesh; "auto": the default number, fewer if the object has fewer
            pixels.
        priors, status, reinitialization, vertex_offsets: settings of the fixed parts.
        template: settings of the object's known shape.
        seed: seed of the search; equal seeds and frame sets result in equal estimates.
    """

    reference: str
    model: ModelSettings
    region: RegionSettings
    synthesis: SynthesisSettings
    objective: ObjectiveSettings
    optimizer: OptimizerSettings
    evaluations: int
    vertices: resolution.Vertices
    priors: priors.Settings
    status: status.Settings
    reinitialization: loss_monitor.Settings
    vertex_offsets: VertexOffsetSettings = field(default_factory=VertexOffsetSettings)
    template: TemplateSettings = field(default_factory=first_image.Settings)
    seed: int = 0


def build_template(settings: TemplateSettings, vertices: resolution.Vertices) -> Template:
    """The template, whose mesh has a typical number of vertices if none is given."""
    return settings.build(resolution.TYPICAL_VERTICES if vertices == "auto" else vertices)


def make_posterior(
    plan: Plan, rig: Rig, model: DeformationModel, observation: Observation, sight: Sight = ALL_SEEN
) -> tuple[Posterior, Mesh]:
    """Posterior of a model, and its mesh with the appearance from the observation and from what a template knows."""
    synthesizer = plan.synthesis.build(rig, model.mesh)
    mesh = replace(
        with_appearance(model.mesh, observation.images, rig, sight),
        appearance=with_appearance(synthesizer.canvas, observation.images, rig, sight).appearance,
    )
    posterior = Posterior(
        model,
        plan.objective.build(rig, mesh, synthesizer),
        StretchPrior(mesh, plan.priors.stretch),
        ShapePrior(model.rest, model.prior),
        MotionPrior(model.rest, ChangeMetric(model.scales, model.roughness), plan.priors),
        patches_of(model.mesh),
    )
    return posterior, mesh


def derived(plan: Plan, model: DeformationModel) -> Mapping[str, tuple[float, ...]]:
    """Numbers in use that follow from the first image unless keys of the tracker give them, by key."""
    parts = {"model": model, "objective": plan.objective}
    found = {f"{part}.{key}": numbers for part, made in parts.items() for key, numbers in _derived(made).items()}
    return {"mesh.vertices": (float(len(model.mesh.vertices)),), **found}


def _derived(part: object) -> Mapping[str, tuple[float, ...]]:
    return part.derived if isinstance(part, HasDerived) else {}


def make_tracker(
    plan: Plan, template: Template, rig: Rig, detection: InitialDetection, observation: Observation
) -> tuple[Tracker, Mesh, VertexOffsets]:
    """A tracker of the detected object, its mesh and the offsets of its vertices; the template is that of the plan.

    Raises:
        DetectionError: the model finds no object of its kind, or the template another one.
        ExtentError: the model cannot be built from the object, which fills the image.
        ModelError: the model cannot be built from the object.
    """
    try:
        model, sight = template.bind(plan.model, detection)
    except ModelError as error:
        if doubts := warnings(detection):
            raise ExtentError(f"the model cannot be made of it: {'; '.join(doubts)}") from error
        raise
    rig = _as_seen(rig, plan.reference, detection)
    posterior, mesh = make_posterior(plan, rig, model, observation, sight)
    optimizer = plan.optimizer.build(posterior.dimension, np.random.default_rng(plan.seed))
    centers = [sensor.camera.center for sensor in rig.sensors.values() if isinstance(sensor.noise, ImageNoise)]
    tracker = Tracker(posterior, optimizer, plan.evaluations, plan.status, sight.registration_m, centers)
    return tracker, mesh, plan.vertex_offsets.build(model, rig.sensors[plan.reference])


def _as_seen(rig: Rig, reference: str, detection: InitialDetection) -> Rig:
    """The rig with as much noise of the reference sensor as the first image shows."""
    sensor = rig.sensors[reference]
    if detection.noise_scale == 1 or not isinstance(sensor.noise, DepthNoise):
        return rig
    noisier = replace(sensor, noise=Scaled(sensor.noise, detection.noise_scale))
    return replace(rig, sensors={**rig.sensors, reference: noisier})

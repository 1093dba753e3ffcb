"""One sequence of E1, followed by several trackers that see the same images."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.objectives import euclidean
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracker.posterior.priors import settings as priors
from abs_service.tracker.synthesis import sparse
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.plan import OptimizerSettings, Plan
from abs_service.tracking.session import TrackingSession
from calib.noise.base import DepthNoise
from evaluation.paper.geometries import bound
from evaluation.paper.geometries.bound import Bound, Priors
from evaluation.paper.geometries.known_sheet import KnownSheet, rig_of
from evaluation.paper.geometries.sensor import PLAIN
from evaluation.scenes.geometries import MovingSheet
from evaluation.scenes.printed_sheet import GREY_DEVIATION, REST, Print, PrintedSheet
from evaluation.scenes.time_of_flight import TimeOfFlight
from evaluation.sequences import PIXELS_ALONE

Array = NDArray[np.float64]

#: What the compared fitness functions are called, and variants of them begin with.
LIKELIHOOD, EUCLIDEAN = "likelihood", "Euclidean"

#: No search is limited.
EVALUATIONS = 1_000_000

#: The Euclidean fitness clamps differences of distances [m] and grey values [levels] to these.
CUTOFF_M, CUTOFF_LEVELS = 0.1, 60.0

#: The paper's budget for 48 dimensions.
PAPER = cma_es.Settings(population=32, generations=1000)


#: Deviations of the priors where nothing else is said. Splines of 4 × 4 control points stretch by up to 0.9 % when the
#: sheets bend: the likelihood has its smallest error with 0.03, not with the 0.02 of the demo rig.
BOTH = Priors(stretch=0.03, speed=0.3)


@dataclass(frozen=True, slots=True)
class Variant:
    """One tracker.

    Attributes:
        likelihood: True for the likelihood as objective, False for the Euclidean fitness.
        frames: number of frames it tracks.
        priors: their deviations.
        vertices, inset: of its mesh, see `KnownSheet`.
        optimizer: its search.
        noise: calibration that it is given, of `Job.noises`.
        rest: exposures that its first frame is the mean of.
        outline_px: deviation of the outline in the likelihood [px]; 0: none, as in the Euclidean fitness.
    """

    likelihood: bool
    frames: int
    priors: Priors = BOTH
    vertices: int = 600
    inset: float = 0.02
    optimizer: OptimizerSettings = field(default_factory=hybrid.Settings)
    noise: str = PLAIN
    rest: int = REST
    outline_px: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class VariantErrors:
    """Errors (frames,) of one variant [mm], without the first frame, in which the sheet is known.

    Attributes:
        control: root mean square of the control points'.
        surface: of the surface's along its normal.
        tracked: share of the frames that the tracker itself takes for tracked.
        theta: control points (4, 4, 3) [m] of the last frame.
    """

    control: Array
    surface: Array
    tracked: float
    theta: Array


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A sequence to track; plain data, so that another process can do it.

    Attributes:
        name, seed: of the sequence; the seed draws its noise.
        sheet, sensor, texture: what is before which camera.
        noises: calibrations of the camera, by name.
        known: the sheet at rest.
        variants: the trackers, by name.
        bound_frames: frames at which bounds are computed.
    """

    name: str
    seed: int
    sheet: MovingSheet
    sensor: TimeOfFlight
    texture: Print
    noises: Mapping[str, DepthNoise]
    known: KnownSheet
    variants: Mapping[str, Variant]
    bound_frames: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class SequenceResult:
    """Result of a job.

    Attributes:
        job: it.
        followed: what each variant made of it.
        bounds: at the frames that the job names, by variant.
        mean_deviation: true σ, the mean over the pixels that show the sheet at rest [m].
        allowed: Euclidean / likelihood that this σ allows where all pixels tell the same: √(mean σ² · mean σ⁻²).
        stretch: root mean square of the true sheet's relative changes of length.
    """

    job: Job
    followed: Mapping[str, VariantErrors]
    bounds: Mapping[str, tuple[Bound, ...]]
    mean_deviation: float
    allowed: float
    stretch: float


def measure(job: Job) -> SequenceResult:
    """Tracks a sequence with all variants at once, and computes the bounds of some of its frames."""
    scene = PrintedSheet(job.sheet, job.sensor, job.texture)
    rest = scene.view(scene.control(0))
    sigma = job.sensor.deviation(rest.distance, job.sensor.amplitude(rest))[rest.share > 0.999]
    mean = float(sigma.mean())
    trackers = {name: _tracking(job, variant, mean) for name, variant in job.variants.items()}
    errors: dict[str, list[tuple[float, float]]] = {name: [] for name in trackers}
    tracked = dict.fromkeys(trackers, 0)
    theta: dict[str, Array] = {}
    most = max(variant.frames for variant in job.variants.values())
    counts = {variant.rest for variant in job.variants.values()}
    first = {rest: next(scene.frames(1, np.random.default_rng(job.seed), rest)) for rest in counts}
    for k, frames in enumerate(scene.frames(most, np.random.default_rng(job.seed))):
        truth = scene.control(k)
        for name, variant in job.variants.items():
            if k < variant.frames:
                estimate = trackers[name].track(frames if k else first[variant.rest], lambda: True)
                theta[name] = estimate.theta.reshape(truth.shape)
                errors[name].append(_errors_mm(theta[name], truth))
                tracked[name] += estimate.status == Status.TRACKING
    followed = {}
    for name in trackers:
        control, surface = np.array(errors[name][1:]).T
        followed[name] = VariantErrors(control, surface, tracked[name] / len(errors[name]), theta[name])
    allowed = float(np.sqrt(np.mean(sigma**2) * np.mean(sigma**-2.0)))
    stretch = float(np.sqrt(np.mean([_stretch(scene.control(k), job.known) ** 2 for k in range(0, most, 5)])))
    return SequenceResult(job, followed, _bounds(scene, job, mean), mean, allowed, stretch)


def _bounds(scene: PrintedSheet, job: Job, mean: float) -> dict[str, tuple[Bound, ...]]:
    found: dict[str, list[Bound]] = {name: [] for name in job.variants}
    for k in job.bound_frames:
        control = scene.control(k)
        images = bound.derivatives(scene, control)
        for name, variant in job.variants.items():
            known = replace(job.known, vertices=variant.vertices, inset=variant.inset)
            found[name].append(bound.bound(control, known, variant.priors, images, mean))
    return {name: tuple(each) for name, each in found.items()}


def _tracking(job: Job, variant: Variant, mean: float) -> TrackingSession:
    """A tracker; as Euclidean fitness it weighs like the likelihood of one deviation everywhere."""
    weights = 0.5 / mean**2, 0.5 / GREY_DEVIATION**2
    squares = euclidean.Settings(
        depth_weight=weights[0], intensity_weight=weights[1], cutoff_m=CUTOFF_M, cutoff_intensity=CUTOFF_LEVELS
    )
    plan = Plan(
        reference="tof",
        model=replace(job.known, vertices=variant.vertices, inset=variant.inset),
        region=nearest.Settings(),
        synthesis=sparse.Settings(),
        objective=replace(PIXELS_ALONE, outline_px=variant.outline_px) if variant.likelihood else squares,
        optimizer=variant.optimizer,
        evaluations=EVALUATIONS,
        vertices=variant.vertices,
        priors=priors.Settings(variant.priors.stretch, variant.priors.speed, minimum_speed=variant.priors.speed),
        status=status.Settings(),
        reinitialization=loss_monitor.Settings(),
        seed=job.seed,
    )
    return TrackingSession(rig_of(job.noises[variant.noise]), plan)


def _errors_mm(control: Array, truth: Array) -> tuple[float, float]:
    """Root mean square errors of control points (4, 4, 3), and along the true normal all over the surface [mm]."""
    basis, normal = bound.surface_frame(truth)
    error = (control - truth).reshape(-1, 3)
    along = np.einsum("ki,ki->k", basis @ error, normal)
    return float(np.sqrt(3 * np.mean(error**2)) * 1e3), float(np.sqrt(np.mean(along**2)) * 1e3)


def _stretch(control: Array, known: KnownSheet) -> float:
    """Root mean square of the relative changes of length."""
    return float(np.sqrt(np.mean(bound.edges(control, known, 1.0)[1] ** 2)))

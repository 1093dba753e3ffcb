"""E2: a sheet that bends as in the FlexPad model, so that the true Θ is known, in front of a sensor of known σ.

The simulator rolls a sheet onto a cylinder, exactly and with code of its own. If the bent direction is one of FlexPad's
four and the cylinder touches the sheet's centre, both sides of that direction are bent alike and all others are flat.

Statistic: ratio of a sequence's error to that of the likelihood without the outline, which the Euclidean fitness does
not have either; mean over eight sequences, with its standard deviation and smallest; errors of the surface (mean of the
frames) and of the eight bends (root mean square).
Goals: below as `MIN_…` and `MAX_…`. Until 2026-11-23 they were ratios of 1, which hardly can be missed; the present
ones were set before they were first run, by one who knew the earlier figures, so another seed is reported as well.
Seeds: two motions of each direction, drawn from the context's seed; docs/results/experiments.md has seeds 0 and 2 (1
shares half of them with 0).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models import flexpad
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracking.plan import OptimizerSettings
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.tof_amplitude import TofAmplitude
from calib.pose import Pose
from calib.rig import Rig, Sensor
from drivers.simulated.scene.motion import Motion, Placement
from drivers.simulated.scene.scene import REST_Z, Scene
from drivers.simulated.scene.texture import smooth_pattern
from drivers.simulated.sensors.optics import OPTICS
from drivers.simulated.sensors.time_of_flight import TimeOfFlight
from drivers.simulated.shapes.rectangle import Rectangle
from drivers.simulated.simulation import Simulation
from evaluation.experiment import Context, Findings, Goal, at_least, at_most
from evaluation.paper.flexpad import report
from evaluation.paper.flexpad.report import Errors, Tracked
from evaluation.paper.wall_calibration import calibrated_noise
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import (
    PIXELS_ALONE,
    TrackedSequence,
    demo_plan,
    euclidean_fitness,
    expose,
    mean_deviation,
    moving_indices,
    track,
)

TITLE = "E2: FlexPad on sheets whose bends are known"

#: The sheet [m], and what of the sensor's light its print reflects, so that σ varies between 3 and 17 mm.
WIDTH, HEIGHT = 0.30, 0.20
REFLECTIVITY = 0.06, 0.9

#: The directions in the order of the model's bends [degrees].
DIRECTIONS = (0, 45, 90, 135)

#: Nearer than this is the sheet, farther the wall [m].
BETWEEN_M = 1.3

#: Residual, in deviations, from which on the likelihood takes a measurement for an outlier (docs/explanation/noise.md).
BOUND = 4.2

MODEL = flexpad.Settings(WIDTH, HEIGHT)

#: Goals: least ratios Euclidean / likelihood, plain (the paper's of E1) and bounded, mean and in every sequence;
#: largest error of the likelihood's surface [mm] and of its bends, which reach 1.3 here.
MIN_PLAIN, MIN_BOUNDED, MIN_ANYWHERE = 1.92, 1.2, 1.0
MAX_SURFACE_MM, MAX_BEND = 0.75, 0.05


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        directions: that sheets bend in, of `DIRECTIONS`.
        motions: sequences of each.
        frames: of each sequence.
        stride: exposures from one frame to the next, at 30 Hz; one is taken of the first second, at rest.
        bend: largest angle between two ends of a sheet [degrees].
        paper_budget_frames: frames of the first sequence that are searched with the paper's budget as well.
        static_frames: frames of each static sequence of the noise calibration.
    """

    directions: tuple[int, ...] = DIRECTIONS
    motions: int = 2
    frames: int = 50
    stride: int = 5
    bend: float = 75.0
    paper_budget_frames: int = 20
    static_frames: int = 10


QUICK = Settings(directions=(0, 135), motions=1, frames=16, stride=8, paper_budget_frames=0, static_frames=2)


@dataclass(frozen=True)
class OneDirection:
    """A motion restricted to bends in one of the directions of FlexPad.

    Attributes:
        motion: what is left of it.
        degrees: the direction, from the long side.
    """

    motion: Motion
    degrees: int

    def at(self, t: float) -> Placement:
        """The placement at time `t` [s] after the start."""
        return replace(self.motion.at(t), direction=np.deg2rad(self.degrees), offset=0.0)


@dataclass(frozen=True)
class Bent:
    """A sheet that bends in one direction and moves.

    Attributes:
        degrees: the direction.
        seed: of its motion, print and noise.
        bend: largest angle between two ends [degrees].
    """

    degrees: int
    seed: int
    bend: float

    @cached_property
    def moves(self) -> OneDirection:
        """Motion of the sheet."""
        rotation, bend = (np.deg2rad(13), np.deg2rad(13), np.deg2rad(10)), np.deg2rad(self.bend)
        motion = Motion(self.seed, (0.0, 0.0, REST_Z), (0.04, 0.03, 0.05), rotation, bend, WIDTH, HEIGHT, 0.0, 0.0)
        return OneDirection(motion, self.degrees)

    def simulation(self) -> Simulation:
        """The sheet before a wall, seen by a time-of-flight sensor of the SR4000's geometry without mean offset."""
        pattern = smooth_pattern(self.seed, WIDTH, HEIGHT, (0.025, 0.01, 0.004), 800.0, (0.1, 0.95), REFLECTIVITY)
        wall = smooth_pattern(self.seed + 1, 4.0, 3.0, (0.2, 0.05), 100.0, (0.3, 0.6), (0.12, 0.7))
        scene = Scene((Rectangle(WIDTH, HEIGHT, self.moves, pattern),), wall)
        return Simulation(scene, {"tof": TimeOfFlight("tof", _camera(), scene, 30.0)}, self.seed, 30.0)

    def errors(self, followed: TrackedSequence) -> Errors:
        """Errors of the estimated parameters."""
        bends, poses = followed.thetas[:, flexpad.BENDS], []
        true = np.zeros_like(bends)
        first = 2 * DIRECTIONS.index(self.degrees)
        for number, estimate in enumerate(followed.estimates):
            placement = self.moves.at(estimate.t_host_ns * 1e-9)
            true[number, first : first + 2] = -2 * MODEL.minimum_radius_m * placement.curvature
            poses.append(pose_error(_unbent(followed.models[number], estimate.theta), placement.T_rp))
        rotation, translation = np.mean(poses, axis=0)
        return Errors(bends, true, followed.thetas[:, flexpad.HEIGHT], float(rotation), float(translation))


def run(settings: Settings, context: Context) -> Findings:
    """Follows all sequences with the Euclidean fitness, bounded and not, and with the likelihood."""
    context.progress("noise calibration")
    noise = calibrated_noise("", settings.static_frames, context.seed)
    bents, tracked, sequences = [], [], []
    for degrees in settings.directions:
        for number in range(settings.motions):
            context.progress(f"bends of {degrees}°, sequence {number + 1}")
            bents.append(Bent(degrees, context.seed + 1 + 10 * degrees + number, settings.bend))
            sequences.append(expose(bents[-1].simulation(), moving_indices(settings.frames, settings.stride)))
            tracked.append(_track(bents[-1], sequences[-1], noise, hybrid.Settings()))
    few, budgets = sequences[0][: settings.paper_budget_frames], {}
    if few:
        context.progress("the paper's budget")
        published = cma_es.Settings(population=16, generations=400)
        searches = {"hybrid": hybrid.Settings(), "CMA-ES, 400 × 16 at most": published}
        budgets = {name: _track(bents[0], few, noise, search) for name, search in searches.items()}
    return Findings(_goals(tracked), report.sections(tracked, budgets, sequences[0]), report.values(tracked))


def _goals(tracked: list[Tracked]) -> tuple[Goal, ...]:
    plain, bounded = (report.ratios(tracked, name, "surface_mm") for name in ("Euclidean", "Euclidean, bounded"))
    surface, bend = (
        float(np.mean([one.figures("likelihood")[key] for one in tracked])) for key in ("surface_mm", "bend")
    )
    limited = "Surface error, Euclidean that is bounded like the likelihood / likelihood"
    return (
        at_least("Surface error, Euclidean / likelihood", float(np.mean(plain)), MIN_PLAIN),
        at_least(limited, float(np.mean(bounded)), MIN_BOUNDED),
        at_least(f"{limited}, in the worst sequence", min(bounded), MIN_ANYWHERE),
        at_most("Surface error of the likelihood", surface, MAX_SURFACE_MM, "mm"),
        at_most("Error of its bends", bend, MAX_BEND),
    )


def _track(bent: Bent, exposures: list[LabeledExposure], noise: TofAmplitude, search: OptimizerSettings) -> Tracked:
    rig = Rig("sheet", {"tof": Sensor("tof", _camera(), noise)})
    deviation = mean_deviation(rig, "tof", exposures[0], BETWEEN_M)
    plain = euclidean_fitness(deviation)
    fitness = {
        "Euclidean": plain,
        "Euclidean, bounded": replace(plain, cutoff_m=BOUND * deviation),
        "likelihood": PIXELS_ALONE,
        "likelihood with the outline": likelihood.Settings(),
    }
    plans = {name: demo_plan(MODEL, objective=objective, optimizer=search) for name, objective in fitness.items()}
    followed = {name: track(rig, plan, exposures) for name, plan in plans.items()}
    errors = {name: bent.errors(one) for name, one in followed.items()}
    return Tracked(f"{bent.degrees}°, seed {bent.seed}", deviation, followed, errors)


def _camera() -> Camera:
    return OPTICS["tof"].camera(OPTICS["tof"].width, OPTICS["tof"].height, Lens())


def _unbent(model: DeformationModel, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices (n, 3) [m] that theta has without its bends: where its pose puts the flat sheet."""
    flat = np.concatenate([np.zeros(flexpad.HEIGHT + 1), theta[flexpad.HEIGHT + 1 :]])
    return model.deform(flat[None]).vertices[0].T.astype(np.float64)


def pose_error(flat: NDArray[np.float64], T_rp: Pose) -> tuple[float, float]:
    """Angle [mrad] and distance [mm] between the pose of a flat mesh (n, 3), a regular grid, and the true one."""
    center = flat.mean(axis=0)
    axes = np.linalg.svd(flat - center, full_matrices=False)[2]  # along the long side, the short side, the normal
    axes *= np.sign(np.einsum("ij,ji->i", axes, T_rp[:3, :3]))[:, None]
    turned = np.linalg.norm(np.cross(axes, T_rp[:3, :3].T), axis=1)
    angle = np.sqrt(np.sum(turned**2) / 2)  # of a small rotation about any axis
    return float(angle * 1e3), float(np.linalg.norm(center - T_rp[:3, 3]) * 1e3)

"""E4 and E5: a flat board whose print biases a time-of-flight sensor; every bend of the estimate is an error.

Statistic: error of every frame, the largest |bend| of FlexPad and the mean distance of NURBS control points from their
plane; the ratio Euclidean / likelihood of its means over all frames.
Goals: the paper's ratios, 3.8 and 1.33 for FlexPad; for NURBS, whose means the paper's text has lost, 2 and 1.
Seeds: two sequences of 500 frames, as many as the paper's, with the context's seed + 1 and + 2.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.models.parts.bends import FULL
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracking.plan import ModelSettings, OptimizerSettings
from calib.lenses.lens import Lens
from calib.noise.tof_amplitude import TofAmplitude
from calib.rig import Rig, Sensor
from drivers.simulated.scene.motion import Motion
from drivers.simulated.scene.scene import REST_Z, Scene
from drivers.simulated.scene.texture import Texture, smooth_pattern
from drivers.simulated.sensors.optics import OPTICS
from drivers.simulated.sensors.time_of_flight import TimeOfFlight, TimeOfFlightNoise
from drivers.simulated.shapes.rectangle import Rectangle
from drivers.simulated.simulation import Simulation
from evaluation.experiment import Context, Findings, Goal, at_least
from evaluation.paper.flat_boards import report
from evaluation.paper.flat_boards.report import Comparison, Published
from evaluation.paper.wall_calibration import calibrated_noise
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import (
    PIXELS_ALONE,
    TrackedSequence,
    demo_plan,
    euclidean_fitness,
    expose,
    mean_deviation,
    track,
)

#: Sides of the boards [m], and their reflectivities in the sensor's light.
WIDTH, HEIGHT = 0.30, 0.20
BLACK, WHITE = 0.15, 0.85

#: Distance between board and wall [m].
BETWEEN_M = 1.3

#: Texels per metre of a print, and the deviation of its blur [m].
_DENSITY, _BLUR = 1600.0, 0.001


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        sequences: each with a motion of its own.
        frames: of each.
        stride: exposures from one frame to the next; 1 is 30 Hz.
        bias: mean offset of the sensor's distances times amplitude [m].
        biases: further ones, evaluated on a part of the first sequence.
        paper_budget_frames: frames of the first sequence that are searched with the paper's budgets as well.
        static_frames: frames of each static sequence of the noise calibration.
    """

    sequences: int = 2
    frames: int = 500
    stride: int = 3
    bias: float = -40.0
    biases: tuple[float, ...] = (0.0, -20.0, -60.0)
    paper_budget_frames: int = 12
    static_frames: int = 10


QUICK = Settings(sequences=1, frames=20, stride=9, biases=(), paper_budget_frames=0, static_frames=2)


@dataclass(frozen=True, eq=False)
class Board:
    """Print of a board and its goals.

    Attributes:
        name: such as "checker board".
        texture: the print.
        published: the paper's figures for FlexPad.
        min_ratios: goals for the ratios of the errors, Euclidean over likelihood, by the model's name.
    """

    name: str
    texture: Texture
    published: Published
    min_ratios: Mapping[str, float]


@dataclass(frozen=True)
class Measure:
    """A model, and its deviation from flat.

    Attributes:
        model: its settings.
        search: with the paper's budget.
        error: of every estimate, in `unit`.
        unit: such as "mm"; "" if none.
    """

    model: ModelSettings
    search: OptimizerSettings
    error: Callable[[TrackedSequence], NDArray[np.float64]]
    unit: str


def largest_bends(followed: TrackedSequence) -> NDArray[np.float64]:
    """Largest |bend| (frames,) of FlexPad, clamped to 2, a radius of `minimum_radius_m`; the true bends are 0."""
    return np.minimum(np.abs(followed.thetas[:, flexpad.BENDS]).max(axis=1), FULL)


def unevenness_mm(followed: TrackedSequence) -> NDArray[np.float64]:
    """Mean distance (frames,) of the control points from their least-squares plane [mm]; the true distance is 0."""
    return np.array([mean_plane_distance(theta.reshape(-1, 3)) for theta in followed.thetas]) * 1e3


def mean_plane_distance(points: NDArray[np.float64]) -> float:
    """Mean distance of points (n, 3) from the plane of least squares through them."""
    arms = points - points.mean(axis=0)
    return float(np.abs(arms @ np.linalg.svd(arms, full_matrices=False)[2][2]).mean())


#: The prior of the bends is weak: one that prefers flat sheets would give the right answer with both fitness functions.
MEASURES: Mapping[str, Measure] = {
    "FlexPad": Measure(
        flexpad.Settings(WIDTH, HEIGHT, bend_deviation=10.0),
        cma_es.Settings(population=16, generations=400),
        largest_bends,
        "",
    ),
    "NURBS": Measure(nurbs.Settings((4, 4), 2), cma_es.Settings(population=32, generations=1000), unevenness_mm, "mm"),
}


def board_print(black: NDArray[np.bool_]) -> Texture:
    """Texture of a board from its mask of black (rows, columns), blurred as by a lens."""
    plane = gaussian_filter(np.where(black, BLACK, WHITE), _BLUR * _DENSITY, mode="nearest").astype(np.float32)
    return Texture(np.repeat(plane[..., None], 4, axis=-1), _DENSITY)


def texel_positions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances [m] of a print's texels (rows, columns) from the board's left and upper rim."""
    rows, columns = round(HEIGHT * _DENSITY) + 1, round(WIDTH * _DENSITY) + 1
    down, across = np.indices((rows, columns)) / _DENSITY
    return across, down


def run(board: Board, settings: Settings, context: Context) -> Findings:
    """Compares both fitness functions with both models on a board."""
    noise = _calibrated(settings.bias, settings, context)
    sequences = [_sequence(board, settings.bias, settings, context, n) for n in range(settings.sequences)]
    compared = [compare(name, noise, sequences, hybrid.Settings(), context) for name in MEASURES]
    goals = [_goal(board, comparison) for comparison in compared]
    if settings.paper_budget_frames:
        short = [sequences[0][: settings.paper_budget_frames]]
        compared += [compare(name, noise, short, measure.search, context) for name, measure in MEASURES.items()]
    by_bias = {bias: _of_bias(board, bias, settings, context) for bias in settings.biases}
    by_bias |= {settings.bias: compared[: len(MEASURES)]} if by_bias else {}
    sections = report.sections(board.name, board.published, sequences[0], noise, compared, by_bias)
    values = {f"{one.model}, {one.search}, {one.frames} frames": one.values for one in compared}
    return Findings(tuple(goals), sections, values)


def simulation(board: Board, seed: int, bias: float) -> Simulation:
    """A board that moves rigidly before a wall, seen by a time-of-flight sensor of the SR4000's geometry."""
    rotation = np.deg2rad(20), np.deg2rad(20), np.deg2rad(15)
    motion = Motion(seed, (0.0, 0.0, REST_Z), (0.06, 0.05, 0.08), rotation, 0.0, WIDTH, HEIGHT, 0.0, 0.0)
    wall = smooth_pattern(seed, 4.0, 3.0, (0.2, 0.05), 100.0, color=(0.3, 0.6), infrared=(0.12, 0.7))
    scene = Scene((Rectangle(WIDTH, HEIGHT, motion, board.texture),), wall)
    optics = OPTICS["tof"]
    camera = optics.camera(optics.width, optics.height, Lens())
    head = TimeOfFlight("tof", camera, scene, 30.0, TimeOfFlightNoise(mu_amplitude=bias))
    return Simulation(scene, {"tof": head}, seed, 30.0)


def compare(
    name: str,
    noise: TofAmplitude,
    sequences: Sequence[Sequence[LabeledExposure]],
    search: OptimizerSettings,
    context: Context,
) -> Comparison:
    """Euclidean fitness and likelihood on the same sequences, with the same mesh, priors and search.

    The initial mesh uses the noise model in both, so that both start with a flat sheet.
    """
    measure = MEASURES[name]
    optics = OPTICS["tof"]
    rig = Rig("board", {"tof": Sensor("tof", optics.camera(optics.width, optics.height, Lens()), noise)})
    equal = euclidean_fitness(mean_deviation(rig, "tof", sequences[0][0], BETWEEN_M))
    followed = {}
    for title, objective in (("Euclidean", equal), ("likelihood", PIXELS_ALONE)):
        context.progress(f"{name}, {title}")
        plan = demo_plan(measure.model, objective=objective, optimizer=search)
        followed[title] = [track(rig, plan, exposures) for exposures in sequences]
    errors = {title: np.concatenate([measure.error(one) for one in runs]) for title, runs in followed.items()}
    return Comparison(name, report.search_name(search), measure.unit, followed, errors)


def _calibrated(bias: float, settings: Settings, context: Context) -> TofAmplitude:
    context.progress(f"noise calibration, bias {bias:g}")
    return calibrated_noise(f"dark={bias}", settings.static_frames, context.seed)


def _sequence(board: Board, bias: float, settings: Settings, context: Context, number: int) -> list[LabeledExposure]:
    context.progress(f"{board.name}, sequence {number + 1}")
    indices = range(0, settings.frames * settings.stride, settings.stride)
    return expose(simulation(board, context.seed + number + 1, bias), indices)


def _of_bias(board: Board, bias: float, settings: Settings, context: Context) -> list[Comparison]:
    """Comparisons of both models with another bias, on frames of the first sequence in which the board moves."""
    exposures = _sequence(board, bias, replace(settings, frames=50), context, 0)
    exposures = [exposures[0], *exposures[14:]]
    noise = _calibrated(bias, settings, context)
    return [compare(name, noise, [exposures], hybrid.Settings(), context) for name in MEASURES]


def _goal(board: Board, comparison: Comparison) -> Goal:
    what = f"{comparison.model} on the {board.name}, error of Euclidean fitness / likelihood"
    return at_least(what, comparison.ratio, board.min_ratios[comparison.model])

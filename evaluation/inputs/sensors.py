"""E7: sensors of four kinds in one likelihood, in every combination that can be initialised, without weights.

The same frames of one simulated sheet for all combinations. A colour camera and a light barrier measure no distance,
which initial detection needs; so there are twelve combinations, not fifteen.

Statistic: mean vertex error over all frames and sequences, with a sensor more over without it; likewise of the surface.
Goal: at most 1.05 for every sensor that is added to every combination.
Seeds: twelve sequences, with seeds that follow the context's.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service import config, wiring
from abs_service.report.content import Column, Section, Table
from calib.noise.images.binary import LightBarrier
from calib.noise.images.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Noise, Rig, Sensor
from drivers.contract.frame import FrameSet
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.sequences import demo_plan, expose, simulate, track

TITLE = "E7: sensors of four kinds, in every combination"

#: Noise models of the sensors except the time of flight, which has the demo's. Those of distances are the simulator's;
#: that of colour includes more than camera noise.
NOISES: dict[str, Noise] = {
    "structured_light": StructuredLight(),
    "color": GaussianColor(15.0),
    "barrier": LightBarrier(0.8485),
}
SENSORS = ("tof", *NOISES)
#: Sensors that can initialise, the more accurate first.
DEPTH = ("structured_light", "tof")

Subset = frozenset[str]
SUBSETS: tuple[Subset, ...] = tuple(
    frozenset(names)
    for size in range(1, len(SENSORS) + 1)
    for names in itertools.combinations(SENSORS, size)
    if set(names) & set(DEPTH)
)

#: Largest allowed ratio of the mean errors with and without one additional sensor.
WORST = 1.05


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        sequences: with seeds that follow each other; many, because sliding of the sheet along itself
            without colour is random.
        frames: of each sequence.
        subsets: the combinations.
    """

    sequences: int = 12
    frames: int = 150
    subsets: tuple[tuple[str, ...], ...] = tuple(tuple(sorted(subset)) for subset in SUBSETS)


#: All with colour: without it the sheet slides along itself by a random amount.
QUICK = Settings(
    1,
    12,
    (
        ("tof", "color"),
        ("structured_light", "color"),
        ("tof", "structured_light", "color"),
        ("tof", "color", "barrier"),
        ("structured_light", "color", "barrier"),
        ("tof", "structured_light", "color", "barrier"),
    ),
)


class SensorSequence:
    """Frames of one sheet by all sensors, with their truth."""

    def __init__(self, seed: int, frames: int):
        simulation = simulate(f"simulated://sheet?seed={seed}&sensors={','.join(SENSORS)}")
        self._cameras = {name: head.camera for name, head in simulation.heads.items()}
        settings = config.load_default()
        self._tof = wiring.noises(settings, next(iter(settings.trackers)))["tof"]
        self._exposures = expose(simulation, range(frames))

    def errors(self, subset: Subset) -> tuple[float, float]:
        """Mean vertex and surface error [mm] of tracking with a subset of the sensors."""
        noises = {"tof": self._tof, **NOISES}
        rig = Rig("e7", {name: Sensor(name, self._cameras[name], noises[name]) for name in SENSORS if name in subset})
        plan = demo_plan(reference=next(name for name in DEPTH if name in subset))
        found = track(
            rig, plan, [replace(exposure, frames=_of(exposure.frames, subset)) for exposure in self._exposures]
        )
        return found.vertex_mm, found.surface_mm


def _of(frames: FrameSet, subset: Subset) -> FrameSet:
    return replace(frames, frames={key: frame for key, frame in frames.frames.items() if frame.sensor in subset})


def ratios(errors: Mapping[Subset, NDArray[np.float64]]) -> dict[tuple[Subset, str], float]:
    """Ratio of the mean errors with and without one additional sensor, for every such pair."""
    return {
        (subset, extra): float(errors[subset | {extra}].mean() / errors[subset].mean())
        for subset in errors
        for extra in SENSORS
        if extra not in subset and subset | {extra} in errors
    }


def run(settings: Settings, context: Context) -> Findings:
    """Tracks every combination, and finds the pair in which an additional sensor gains least."""
    found = {frozenset(subset): np.zeros((settings.sequences, 2)) for subset in settings.subsets}
    for row in range(settings.sequences):
        scene = SensorSequence(context.seed + 1 + row, settings.frames)
        for subset, errors in found.items():
            context.progress(f"seed {context.seed + 1 + row}, {' + '.join(sorted(subset))}")
            errors[row] = scene.errors(subset)
    goals = tuple(_goal(found, column, name) for column, name in enumerate(("vertex", "surface")))
    values = {" + ".join(sorted(subset)): errors for subset, errors in found.items()}
    return Findings(goals, (Section("Errors", (_table(found),)),), {"errors_mm": values})


def _goal(found: Mapping[Subset, NDArray[np.float64]], column: int, name: str) -> Goal:
    of_pairs = ratios({subset: errors[:, column] for subset, errors in found.items()})
    (subset, extra), ratio = max(of_pairs.items(), key=lambda item: item[1])
    what = f"Worst of {len(of_pairs)} ratios of the {name} error with and without one sensor ({extra} added to "
    return at_most(f"{what}{' + '.join(sorted(subset))})", ratio, WORST)


def _table(found: Mapping[Subset, NDArray[np.float64]]) -> Table:
    columns = (*(Column(name) for name in SENSORS), Column("vertex error", "mm"), Column("surface error", "mm"))
    rows = []
    for subset, errors in found.items():
        marks = ("×" if name in subset else "" for name in SENSORS)
        cells = (f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(errors.mean(axis=0), errors.std(axis=0)))
        rows.append((*marks, *cells))
    return Table("Mean over the sequences ± their spread", columns, tuple(rows))

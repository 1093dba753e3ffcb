"""Every synthesis on the same sequences, whose sensors have distorting lenses: accuracy and time of warped input.

The demo rig and a second depth sensor, structured light. A frame costs the median of the processor time from images to
estimate; a candidate the least of many times for a population, per member, all syntheses in turns.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives.base import ObservedObjective
from abs_service.tracker.synthesis import dense, sparse, undistorted, warped
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import SynthesisSettings
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import demo_plan, demo_rig, expose, simulate, track

SYNTHESES: Mapping[str, SynthesisSettings] = {
    "sparse": sparse.Settings(),
    "undistorted": undistorted.Settings(),
    "warped": warped.Settings(),
    "dense, step 4": dense.Settings(4),
    "dense, step 2": dense.Settings(2),
    "dense": dense.Settings(),
}

#: Barrel lens of all sensors.
LENS = "-0.25,0.06"
#: Candidates of the population that is timed, and how often.
POPULATION, TIMES = 32, 300


@dataclass(frozen=True, eq=False)
class Recorded:
    """The exposures of one seed, and the rig that took them."""

    rig: Rig
    exposures: Sequence[LabeledExposure]


@dataclass(frozen=True)
class Row:
    """Figures of a synthesis: mean vertex error [mm] of every sequence, and means over them.

    Attributes:
        frame_ms: processor time of a frame [ms].
    """

    vertex_mm: tuple[float, ...]
    surface_mm: float
    frame_ms: float


def recorded(seed: int, frames: int) -> Recorded:
    """The exposures of one seed."""
    sensors = "sensors=tof,color,structured_light"
    simulation = simulate(f"simulated://sheet?seed={seed}&{sensors}&lens={LENS}")
    depth = Sensor("structured_light", simulation.heads["structured_light"].camera, StructuredLight())
    known = demo_rig(simulate(f"simulated://sheet?seed={seed}&sensors=tof,color&lens={LENS}"))
    return Recorded(Rig("e9", {**known.sensors, depth.name: depth}), expose(simulation, range(frames)))


def measured(synthesis: SynthesisSettings, sequences: Sequence[Recorded]) -> Row:
    """Tracks all sequences with a synthesis."""
    found = [track(one.rig, demo_plan(synthesis=synthesis), one.exposures) for one in sequences]
    return Row(
        tuple(one.vertex_mm for one in found),
        float(np.mean([one.surface_mm for one in found])),
        float(np.mean([one.median_ms for one in found])),
    )


def candidates_us(names: Sequence[str], sequence: Recorded) -> dict[str, float]:
    """Time to synthesise one candidate of a sequence's first frame and to compare it [µs], for every synthesis."""
    model = Rigid(track(sequence.rig, demo_plan(), sequence.exposures[:1]).model.mesh)
    thetas = np.random.default_rng(0).normal(0, 2e-3, (POPULATION, 6))
    objectives = {name: _objective(SYNTHESES[name], sequence, model) for name in names}
    least = dict.fromkeys(names, np.inf)
    for _ in range(TIMES):
        for name, objective in objectives.items():
            surface = model.deform(thetas)  # a new one: the last synthesis is cached
            begin = time.process_time()
            objective.cost(surface)
            least[name] = min(least[name], time.process_time() - begin)
    return {name: seconds / POPULATION * 1e6 for name, seconds in least.items()}


def _objective(synthesis: SynthesisSettings, sequence: Recorded, model: Rigid) -> ObservedObjective:
    """Objective of the first frame."""
    rig, mesh = sequence.rig, model.mesh
    objective = demo_plan().objective.build(rig, mesh, synthesis.build(rig, mesh))
    return objective.observe(Observer(rig).observe(sequence.exposures[0].frames), model.deform(model.rest[None]))

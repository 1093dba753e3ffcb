"""E9: accuracy and cost of every synthesis on the same sequences, whose sensors have lenses.

  python -m tests.evaluation.synthesis [--seeds 1 2 3] [--frames 120] [--lens=-0.25,0.06]

The demo rig and a second depth sensor, structured light. Exposures are rendered beforehand. A frame costs the median of
the processor time from images to estimate; a candidate the least of many times for a population, per member.
"""

import argparse
import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from abs_service.evaluation import TruthComparison
from abs_service.observation import Observer
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.synthesis import dense, sparse, undistorted, warped
from abs_service.tracking import SynthesisSettings, Tracking
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from drivers.frame import FrameSet
from tests.tracker.driving import default_plan, frame_set, rig_of, simulate

SYNTHESES: dict[str, SynthesisSettings] = {
    "`sparse`": sparse.Settings(),
    "`undistorted`": undistorted.Settings(),
    "`warped`": warped.Settings(),
    "`dense`, step 4": dense.Settings(4),
    "`dense`, step 2": dense.Settings(2),
    "`dense`": dense.Settings(),
}

#: Candidates of the population that is timed.
POPULATION = 32


class Recorded:
    """Exposures of one seed with what is true of them."""

    def __init__(self, seed: int, lens: str, frames: int):
        simulation = simulate(f"simulated://sheet?seed={seed}&sensors=tof,color,structured_light&lens={lens}")
        depth = Sensor("structured_light", simulation.heads["structured_light"].camera, StructuredLight())
        self.rig = Rig("e9", {**rig_of(simulation).sensors, depth.name: depth})
        exposures = [simulation.expose(k) for k in range(frames)]
        self.frames: list[FrameSet] = [frame_set(images, k) for k, (images, _) in enumerate(exposures)]
        self.truths = [truth for _, truth in exposures]


def track(sequence: Recorded, synthesis: SynthesisSettings) -> tuple[float, float, float, Mesh]:
    """Mean vertex and surface error [mm], median processor time of a frame [ms], and the mesh."""
    tracking = Tracking(sequence.rig, dataclasses.replace(default_plan(), synthesis=synthesis))
    truths, errors, times = TruthComparison(), [], []
    for k, (frames, truth) in enumerate(zip(sequence.frames, sequence.truths)):
        truths.add_truth(truth.t_host_ns, truth.points_r)
        begin = time.process_time()
        estimate = tracking.track(frames, lambda: True)
        times.append(time.process_time() - begin)
        if k == 0 and tracking.mesh is not None:
            truths.add_topology(tracking.mesh.vertices, tracking.made_ns)
        errors.append(truths.compare(truth.t_host_ns, estimate.vertices))
    if tracking.mesh is None:
        raise RuntimeError("nothing was found in the sequence")
    vertex_mm, surface_mm = np.mean([(error.vertex_mm, error.surface_mm) for error in errors if error], axis=0)
    return vertex_mm, surface_mm, float(np.median(times)) * 1e3, tracking.mesh


def candidate_us(sequence: Recorded, synthesis: SynthesisSettings, mesh: Mesh) -> float:
    """Time to synthesise and compare one candidate in the first frame [µs]."""
    plan, model = default_plan(), Rigid(mesh)
    objective = plan.objective.build(sequence.rig, mesh, synthesis.build(sequence.rig, mesh))
    objective.observe(Observer(sequence.rig).observe(sequence.frames[0]), model.deform(model.rest[None]))
    thetas = np.random.default_rng(0).normal(0, 2e-3, (POPULATION, 6))
    times = []
    for _ in range(30):
        surface = model.deform(thetas)
        begin = time.process_time()
        objective.cost(surface)
        times.append(time.process_time() - begin)
    return min(times) / POPULATION * 1e6


def row(name: str, sequences: Sequence[Recorded]) -> str:
    """A line of the table: mean over the seeds, and every seed's vertex error."""
    synthesis = SYNTHESES[name]
    results = [track(sequence, synthesis) for sequence in sequences]
    vertex, surface, frame_ms = (np.array([result[i] for result in results]) for i in range(3))
    candidate = candidate_us(sequences[0], synthesis, results[0][3])
    each = ", ".join(f"{value:.2f}" for value in vertex)
    return f"| {name} | {vertex.mean():.2f} ({each}) | {surface.mean():.2f} | {frame_ms.mean():.0f} | {candidate:.0f} |"


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--lens", default="-0.25,0.06")
    arguments = parser.parse_args()
    sequences = [Recorded(seed, arguments.lens, arguments.frames) for seed in arguments.seeds]
    print("| synthesis | vertex error mm (seeds) | surface error mm | ms a frame | µs a candidate |")
    print("|---|---|---|---|---|")
    for name in SYNTHESES:
        print(row(name, sequences), flush=True)


if __name__ == "__main__":
    main()

"""E7 of the paper: sensors of four kinds in one likelihood, in every combination that can begin, without a weight.

  python -m tests.evaluation.sensors [--seeds 1 2 3] [--frames 150]

The same frames of one simulated sheet for all combinations. A colour camera and a light barrier measure no distance,
and without one nobody knows where the sheet is when tracking begins; so there are twelve combinations, not fifteen.
"""

import argparse
import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.commands import plans
from abs_service.evaluation import TruthComparison
from abs_service.tracking import Tracking
from calib.noise.binary import LightBarrier
from calib.noise.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Noise, Rig, Sensor
from drivers.frame import Frame
from tests.tracker.driving import CONFIG, TRACKER, default_plan, frame_set, simulate

#: How each sensor errs. The distances' laws are the simulator's; a colour's covers what is no noise of the camera, too.
NOISES: dict[str, Noise] = {
    "tof": plans.noises(CONFIG, TRACKER)["tof"],
    "structured_light": StructuredLight(),
    "color": GaussianColor(15.0),
    "barrier": LightBarrier(0.8485),
}
#: Those that find the sheet, the better first.
DEPTH = ("structured_light", "tof")

Subset = frozenset[str]
SUBSETS: tuple[Subset, ...] = tuple(
    frozenset(names)
    for size in range(1, len(NOISES) + 1)
    for names in itertools.combinations(NOISES, size)
    if set(names) & set(DEPTH)
)


class Scene:
    """The frames of one sheet as all sensors saw it, and where it was."""

    def __init__(self, seed: int, frames: int):
        self._simulation = simulate(f"simulated://sheet?seed={seed}&sensors={','.join(NOISES)}")
        self._exposures = [self._simulation.expose(k) for k in range(frames)]

    def errors(self, subset: Subset) -> tuple[float, float]:
        """Mean vertex and surface error [mm] of what the sensors of a subset make of it."""
        cameras = {name: head.camera for name, head in self._simulation.heads.items()}
        rig = Rig("e7", {name: Sensor(name, cameras[name], NOISES[name]) for name in NOISES if name in subset})
        reference = next(name for name in DEPTH if name in subset)
        tracking, truths = Tracking(rig, default_plan(reference=reference)), TruthComparison()
        errors = []
        for k, (frames, truth) in enumerate(self._exposures):
            truths.add_truth(truth.t_host_ns, truth.points_r)
            estimate = tracking.track(frame_set(_of(frames, subset), k), lambda: True)
            if k == 0 and tracking.mesh is not None:
                truths.add_topology(tracking.mesh.vertices, tracking.made_ns)
            found = truths.compare(truth.t_host_ns, estimate.vertices)
            if found is None:
                raise RuntimeError(f"no mesh in exposure {k} for {sorted(subset)}")
            errors.append(dataclasses.astuple(found))
        vertex_mm, surface_mm = np.mean(errors, axis=0)
        return float(vertex_mm), float(surface_mm)


def _of(frames: Sequence[Frame], subset: Subset) -> list[Frame]:
    return [frame for frame in frames if frame.sensor in subset]


def ratios(errors: Mapping[Subset, NDArray[np.float64]]) -> dict[tuple[Subset, str], float]:
    """Mean error (of arrays over the seeds) with one sensor more, over that without, for every such pair."""
    return {
        (subset, extra): float(errors[subset | {extra}].mean() / errors[subset].mean())
        for subset in errors
        for extra in NOISES
        if extra not in subset and subset | {extra} in errors
    }


def main() -> None:
    """Prints the table, and the pair in which one sensor more gains least."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=150)
    arguments = parser.parse_args()
    found = {subset: np.zeros((len(arguments.seeds), 2)) for subset in SUBSETS}
    for row, seed in enumerate(arguments.seeds):
        scene = Scene(seed, arguments.frames)
        for subset in SUBSETS:
            found[subset][row] = scene.errors(subset)
    print(f"| {' | '.join(NOISES)} | vertex error mm | surface error mm |")
    print("|" + "---|" * (len(NOISES) + 2))
    for subset, errors in found.items():
        marks = ("×" if name in subset else "" for name in NOISES)
        cells = (f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(errors.mean(axis=0), errors.std(axis=0, ddof=1)))
        print(f"| {' | '.join([*marks, *cells])} |")
    for column, name in enumerate(("vertex", "surface")):
        of_pairs = ratios({subset: errors[:, column] for subset, errors in found.items()})
        (subset, extra), ratio = max(of_pairs.items(), key=lambda item: item[1])
        print(
            f"worst of {len(of_pairs)} ratios of the {name} error, with and without one sensor: {ratio:.3f}, "
            f"{extra} added to {' + '.join(sorted(subset))}"
        )


if __name__ == "__main__":
    main()

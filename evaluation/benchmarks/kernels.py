"""Time to deform, synthesise and score, for every model, sensor and lens, beside a C++ reference loop.

    NUMBA_NUM_THREADS=2 python -m evaluation.benchmarks.kernels --rounds 100

prints JSON. The yardstick is a fused, hand-vectorised loop for degree 2 and one knot span (deform, project, compare),
kept outside the repository; its folder is `../shared/bench`, or what ABS_SHARED_BENCH says. All cases are measured
in turn, round by round; the minimum is reported. Times vary between machines and hours, ratios less so.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.appearance import with_appearance
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.detection.strip.strip_detection import Strip
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.models.flexpad import FlexPad
from abs_service.tracker.models.gravity import Gravity
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.objectives.base import ObservedTerms
from abs_service.tracker.synthesis import sparse, undistorted, warped
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import SynthesisSettings
from calib import jit, pose
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import flat, sheet
from tests.abs_service.tracking.driving import frame_set, rig_of, simulate

POPULATION, VERTICES = 32, 1024
NOISES = {
    "tof": rig_of(simulate("simulated://sheet")).sensors["tof"].noise,
    "color": GaussianColor(),
    "bayer": GaussianBayer(),
    "structured_light": StructuredLight(),
}
SPARSE = sparse.Settings()
BARREL, FISHEYE = "&lens=-0.25,0.06", "&lens_model=fisheye"
BESIDE = Path(__file__).parents[3] / "shared" / "bench"


@dataclass(frozen=True, slots=True)
class Case:
    """Something to measure.

    Attributes:
        part: what it is.
        work: vertices times candidates.
        call: what is timed.
    """

    part: str
    work: int
    call: Callable[[], object]


def flat_sheet(side: int) -> Mesh:
    """A flat mesh of side × side vertices, 1 m before the sensor."""
    return sheet(side, side, flat)


def nurbs_of(shape: tuple[int, int], mesh: Mesh | None = None) -> DeformationModel:
    """A surface of degree 2."""
    return nurbs.Settings(control_points=shape, degree=2).of_mesh(mesh or flat_sheet(32))


def population(model: DeformationModel, size: int = POPULATION) -> NDArray[np.float64]:
    """Candidates (size, dim) around the rest that move the surface by some millimetres."""
    spread = np.random.default_rng(1).normal(0, 2e-3, (size, len(model.rest)))
    return model.rest + spread * model.scales


def objective_of(
    model: DeformationModel, sensors: tuple[str, ...], synthesis: SynthesisSettings = SPARSE, lens: str = ""
) -> ObservedTerms:
    """The likelihood of what sensors of the simulator see, an exposure observed; `tof/2` is `tof` once more."""
    heads = {name: name.partition("/")[0] for name in sensors}
    simulation = simulate(f"simulated://wall?sensors={','.join(dict.fromkeys(heads.values()))}{lens}")
    cameras = {name: simulation.heads[head].camera for name, head in heads.items()}
    rig = Rig("r", {name: Sensor(name, cameras[name], NOISES[head]) for name, head in heads.items()})
    observation = Observer(rig).observe(frame_set(simulation.frames(0), 0))
    synthesizer = synthesis.build(rig, model.mesh)
    appearance = with_appearance(synthesizer.canvas, observation.images, rig).appearance
    mesh = replace(with_appearance(model.mesh, observation.images, rig), appearance=appearance)
    objective = likelihood.Settings().build(rig, mesh, synthesizer)
    observed = objective.observe(observation, model.deform(model.rest[None]))
    fits = observed.fits(model.deform(model.rest[None]))
    assert all(fit.inliers > 0.9 * len(mesh.vertices) for fit in fits), fits
    return observed


def whole(
    part: str,
    model: DeformationModel,
    sensors: tuple[str, ...] = ("tof",),
    synthesis: SynthesisSettings = SPARSE,
    lens: str = "",
    size: int = POPULATION,
) -> Case:
    """Deform, synthesise and compare."""
    objective, thetas = objective_of(model, sensors, synthesis, lens), population(model, size)
    return Case(part, size * len(model.mesh.vertices), lambda: objective.cost(model.deform(thetas)))


def models() -> dict[str, DeformationModel]:
    """The models on about as many vertices, 1 m before the sensor."""
    T_rp = pose.from_rotation_vector([0, 0, 0], [0, 0, 1])
    T_rg = pose.from_rotation_vector([np.pi, 0, 0], [-0.15, 0, 1])  # its z points to the sensor
    strip = Strip(T_rg, 0.3, 0.2, np.zeros(65), 0.0)
    return {
        **{f"NURBS {k}×{k}": nurbs_of((k, k)) for k in (3, 4, 6)},
        "FlexPad": FlexPad(Sheet(T_rp, 0.3, 0.2), VERTICES, 0.1, 1.0),
        "gravity": Gravity(strip, 4, True, VERTICES, np.array([0.0, 1.0, 0.0])),
        "rigid": Rigid(sheet(32, 32, flat)),
    }


def cases() -> list[Case]:
    """All rows of the table but the yardstick."""
    three = ("tof", "color", "structured_light")
    made = models()
    surface = made["NURBS 4×4"]
    thetas = population(surface)
    deformed, work = surface.deform(thetas), POPULATION * VERTICES
    camera, bare = simulate("simulated://sheet").heads["tof"].camera, np.zeros((VERTICES, 0), np.float32)
    view = sparse.SparseView(camera, surface.mesh.faces, bare).unoccluded(deformed)
    return [
        *(whole(f"{name}, ToF", model) for name, model in made.items()),
        Case("NURBS 4×4: deform alone", work, lambda: surface.deform(thetas)),
        Case("NURBS 4×4: synthesise alone", work, lambda: view.synthesize(deformed)),
        whole("NURBS 4×4, structured light", surface, ("structured_light",)),
        whole("NURBS 4×4, RGB", surface, ("color",)),
        whole("NURBS 4×4, Bayer", surface, ("bayer",)),
        whole("NURBS 4×4, ToF through a barrel lens", surface, lens=BARREL),
        whole("NURBS 4×4, ToF through a fisheye", surface, lens=FISHEYE),
        whole("NURBS 4×4, ToF, barrel, undistorted input", surface, synthesis=undistorted.Settings(), lens=BARREL),
        whole("NURBS 4×4, ToF, barrel, warped input", surface, synthesis=warped.Settings(), lens=BARREL),
        whole("NURBS 4×4, ToF + RGB + structured light, barrel", surface, three, lens=BARREL),
        whole("NURBS 4×4, the same three, warped input", surface, three, warped.Settings(), BARREL),
    ]


def yardstick(threads: int) -> Callable[[], float]:
    """Function that times the reference loop [s per vertex and candidate]; it returns NaN if that is not installed."""
    folder = Path(os.environ.get("ABS_SHARED_BENCH", BESIDE))
    if not (folder / "run_yardstick.py").is_file():
        return lambda: float("nan")
    sys.path.insert(0, str(folder))
    import run_yardstick  # pyright: ignore[reportMissingImports]

    return lambda: 1e-9 * run_yardstick.yardstick_ns(VERTICES, POPULATION, threads, repeats=10)


def minima(cases: list[Case], rounds: int, reference: Callable[[], float]) -> dict[str, float]:
    """Least time [ns per vertex and candidate] of every case and of the yardstick, measured in turn."""
    times = {case.part: np.inf for case in cases} | {"yardstick": np.inf}
    for case in cases:
        case.call()
    for _ in range(rounds):
        for case in cases:
            # Three times: the caches hold what was measured before.
            times[case.part] = min(times[case.part], *(seconds(case.call) / case.work for _ in range(3)))
        times["yardstick"] = float(np.minimum(times["yardstick"], reference()))
    return {part: 1e9 * time for part, time in times.items()}


def seconds(call: Callable[[], object]) -> float:
    """Duration of a call [s]."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=100)
    threads = int(os.environ.get(jit.THREADS, "1"))
    print(json.dumps(minima(cases(), parser.parse_args().rounds, yardstick(threads))))


if __name__ == "__main__":
    main()

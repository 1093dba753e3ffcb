"""E8 of the paper: a Bayer mosaic compared pixel by pixel with the filter's own channel, against demosaiced images.

  python -m tests.evaluation.bayer [--seeds 1 2 3] [--held-out 9] [--frames 60] [--orders rggb]
                                   [--blur 0] [--crosstalk 0] [--vertices 300]

Structured light and a Bayer camera of 640×480 see a finely printed sheet; the same exposures for all variants, and
OpenCV's demosaicing counts as time of the tracker. One rule chooses the deviation of every variant: of `SIGMAS`, each
twice the one before, that with the smallest mean vertex error in the scene of the held-out seed, once for each order.
"""

import argparse
import dataclasses
import time
from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.evaluation import TruthComparison
from abs_service.readers import BAYER_ORDERS
from abs_service.tracking import Tracking
from calib.noise.bayer import GaussianBayer
from calib.noise.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from drivers.frame import Frame, Kind
from tests.tracker.driving import default_plan, frame_set, simulate

#: Suffix of OpenCV's code for each way of demosaicing.
CODES: Mapping[str, str] = {"bilinear": "", "edge-aware": "_EA"}
VARIANTS = ("direct", *CODES)
#: Deviations [levels of 256] to choose from.
SIGMAS = (10.0, 20.0, 40.0, 80.0, 160.0)


@dataclasses.dataclass(frozen=True)
class Result:
    """Means over the frames: errors of vertices, along the surface and of the surface [mm]; processor time [ms]."""

    vertex_mm: float
    along_mm: float
    surface_mm: float
    cpu_ms: float


class Scene:
    """The exposures of one finely printed sheet, and where it was."""

    def __init__(
        self,
        seed: int,
        frames: int,
        order: str = "rggb",
        blur: float = 0.0,
        crosstalk: float = 0.0,
        vertices: int = 300,
    ):
        self._simulation = simulate(
            f"simulated://sheet?seed={seed}&sensors=structured_light,bayer&texture=fine&bayer=640x480"
            f"&order={order}&blur={blur}&crosstalk={crosstalk}"
        )
        self._order = order
        self._plan = default_plan(reference="structured_light", vertices=vertices)
        self._exposures = [self._simulation.expose(k) for k in range(frames)]

    def track(self, variant: str, sigma: float) -> Result:
        """What a variant with a deviation makes of the exposures; the first frame is not timed, it makes the mesh."""
        tracking = Tracking(self._rig(variant, sigma), self._plan)
        truths = TruthComparison()
        errors, seconds = [], []
        for k, (frames, truth) in enumerate(self._exposures):
            truths.add_truth(truth.t_host_ns, truth.points_r)
            start = time.process_time()
            estimate = tracking.track(frame_set([self._prepared(frame, variant) for frame in frames], k), lambda: True)
            seconds.append(time.process_time() - start)
            if k == 0 and tracking.mesh is not None:
                truths.add_topology(tracking.mesh.vertices, tracking.made_ns)
            found = truths.compare(truth.t_host_ns, estimate.vertices)
            if found is None:
                raise RuntimeError(f"no mesh in exposure {k} for {variant}")
            along = np.sqrt(max(found.vertex_mm**2 - found.surface_mm**2, 0.0))
            errors.append((found.vertex_mm, along, found.surface_mm))
        vertex, along, surface = (float(mean) for mean in np.mean(errors, axis=0))
        return Result(vertex, along, surface, float(np.mean(seconds[1:]) * 1e3))

    def _rig(self, variant: str, sigma: float) -> Rig:
        noises = {
            "structured_light": StructuredLight(),
            "bayer": GaussianBayer(sigma) if variant == "direct" else GaussianColor(sigma),
        }
        heads = self._simulation.heads
        return Rig("e8", {name: Sensor(name, heads[name].camera, noise) for name, noise in noises.items()})

    def _prepared(self, frame: Frame, variant: str) -> Frame:
        if frame.kind != Kind.BAYER or variant == "direct":
            return frame
        code = getattr(cv2, f"COLOR_Bayer{self._order.upper()}2RGB{CODES[variant]}")
        rgb = np.asarray(cv2.demosaicing(np.asarray(frame.data, np.uint8), code), np.uint8)
        return dataclasses.replace(frame, kind=Kind.COLOR, stream="color", data=rgb, encoding="rgb8")


def chosen(scene: Scene) -> dict[str, float]:
    """For each variant the deviation of `SIGMAS` with the smallest mean vertex error in a scene."""
    return {
        variant: min(SIGMAS, key=lambda sigma, variant=variant: scene.track(variant, sigma).vertex_mm)
        for variant in VARIANTS
    }


def compared(scenes: Sequence[Scene], sigmas: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    """Results (scenes, 4) of each variant, in the order of the fields of `Result`."""
    found: dict[str, list[tuple[float, ...]]] = {variant: [] for variant in sigmas}
    for scene in scenes:
        for variant, sigma in sigmas.items():  # in turn, so that a machine that gets slower does so for all
            found[variant].append(dataclasses.astuple(scene.track(variant, sigma)))
    return {variant: np.array(results) for variant, results in found.items()}


def main() -> None:
    """Prints a row for each order and variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--held-out", type=int, default=9)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--orders", nargs="+", choices=sorted(BAYER_ORDERS), default=["rggb"])
    parser.add_argument("--blur", type=float, default=0.0, help="defocus of the Bayer camera [px]")
    parser.add_argument("--crosstalk", type=float, default=0.0, help="share that a pixel's neighbours read")
    parser.add_argument("--vertices", type=int, default=300, help="of the mesh, each a sample of the picture")
    arguments = parser.parse_args()
    if arguments.held_out in arguments.seeds:
        parser.error(f"--held-out {arguments.held_out} is among --seeds: it would choose σ where it is judged")
    print("| order | variant | σ | vertex mm (each seed) | along the surface mm | surface mm | CPU ms | of direct |")
    print("|" + "---|" * 8)
    for order in arguments.orders:
        optics = (arguments.frames, order, arguments.blur, arguments.crosstalk, arguments.vertices)
        sigmas = chosen(Scene(arguments.held_out, *optics))
        results = compared([Scene(seed, *optics) for seed in arguments.seeds], sigmas)
        direct_ms = results["direct"][:, 3].mean()
        for variant, of_seeds in results.items():
            vertex, along, surface, cpu = of_seeds.mean(axis=0)
            each = ", ".join(f"{value:.3f}" for value in of_seeds[:, 0])
            print(
                f"| {order} | {variant} | {sigmas[variant]:.0f} | {vertex:.3f} ({each}) | {along:.3f} | {surface:.3f} "
                f"| {cpu:.0f} | {cpu / direct_ms:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()

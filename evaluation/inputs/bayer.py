"""E8: a Bayer mosaic compare pixel by pixel with the filter's own channel, against demosaiced images.

Structured light and a Bayer camera of 640×480 see a finely printed sheet; the same exposures for all variants, and
OpenCV's demosaicing is part of the tracker's time. The σ of every variant is selected by one rule: of `SIGMAS`, the
one with the smallest mean vertex error on a sequence whose seed is not evaluated, once for each order.

Statistic: mean vertex error over the evaluated sequences, direct over that of the best demosaicing.
Goal: at most 1 in every order of the filter, and with a blurred picture.
Seeds: three sequences, with seeds that follow the context's; σ is selected on another.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Cell, Column, Section, Table
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from drivers.contract.frame import Frame, FrameSet, Kind
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.sequences import demo_plan, expose, simulate, track

TITLE = "E8: a Bayer mosaic, direct and demosaiced"

#: Suffix of OpenCV's code for each way of demosaicing.
CODES: Mapping[str, str] = {"bilinear": "", "edge-aware": "_EA"}
VARIANTS = ("direct", *CODES)
#: Deviations [levels of 256] to choose from.
SIGMAS = (10.0, 20.0, 40.0, 80.0, 160.0)


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        sequences: with seeds that follow each other.
        frames: of each sequence.
        orders: of the mosaic's colours, in a picture in focus.
        sigmas: deviations to choose from [levels of 256].
        blur: defocus of the camera [px] and share of crosstalk of one more case, in the first order; none if both
            are 0.
        vertices: of the mesh, each a sample of the picture.
    """

    sequences: int = 3
    frames: int = 60
    orders: tuple[str, ...] = ("rggb", "bggr", "grbg", "gbrg")
    sigmas: tuple[float, ...] = SIGMAS
    blur: tuple[float, float] = (0.7, 0.1)
    vertices: int = 300


QUICK = Settings(1, 10, ("rggb",), (80.0,), (0.0, 0.0))


@dataclass(frozen=True)
class Result:
    """Means over the frames: errors of vertices, along the surface and of the surface [mm]; processor time [ms]."""

    vertex_mm: float
    along_mm: float
    surface_mm: float
    cpu_ms: float


class MosaicSequence:
    """Exposures of one finely printed sheet with their truth, tracked by every variant."""

    def __init__(
        self,
        seed: int,
        frames: int,
        order: str = "rggb",
        blur: float = 0.0,
        crosstalk: float = 0.0,
        vertices: int = 300,
    ):
        simulation = simulate(
            f"simulated://sheet?seed={seed}&sensors=structured_light,bayer&texture=fine&bayer=640x480"
            f"&order={order}&blur={blur}&crosstalk={crosstalk}"
        )
        self._cameras = {name: head.camera for name, head in simulation.heads.items()}
        self._order = order
        self._plan = demo_plan(reference="structured_light", vertices=vertices)
        self._exposures = expose(simulation, range(frames))

    def track(self, variant: str, sigma: float) -> Result:
        """Tracks the exposures with a variant and its σ; the first frame, which makes the mesh, is not timed."""
        prepared, seconds = [], []
        for exposure in self._exposures:
            begin = time.process_time()
            prepared.append(replace(exposure, frames=self._prepared(exposure.frames, variant)))
            seconds.append(time.process_time() - begin)
        found = track(self._rig(variant, sigma), self._plan, prepared)
        along = np.mean([np.sqrt(max(one.vertex_mm**2 - one.surface_mm**2, 0.0)) for one in found.errors])
        cpu_ms = np.mean(found.cpu_ms[1:]) + 1e3 * np.mean(seconds[1:])
        return Result(found.vertex_mm, float(along), found.surface_mm, float(cpu_ms))

    def _rig(self, variant: str, sigma: float) -> Rig:
        noises = {
            "structured_light": StructuredLight(),
            "bayer": GaussianBayer(sigma) if variant == "direct" else GaussianColor(sigma),
        }
        return Rig("e8", {name: Sensor(name, self._cameras[name], noise) for name, noise in noises.items()})

    def _prepared(self, frames: FrameSet, variant: str) -> FrameSet:
        if variant == "direct":
            return frames
        made = [self._demosaiced(one, variant) if one.kind == Kind.BAYER else one for one in frames.frames.values()]
        return replace(frames, frames={frame.key: frame for frame in made})

    def _demosaiced(self, frame: Frame, variant: str) -> Frame:
        code = getattr(cv2, f"COLOR_Bayer{self._order.upper()}2RGB{CODES[variant]}")
        rgb = np.asarray(cv2.demosaicing(np.asarray(frame.data, np.uint8), code), np.uint8)
        return replace(frame, kind=Kind.COLOR, stream="color", data=rgb, encoding="rgb8")


def select_sigmas(scene: MosaicSequence, sigmas: Sequence[float]) -> dict[str, float]:
    """Selects per variant the σ with the smallest mean vertex error in a sequence; a single one needs no run."""
    if len(sigmas) == 1:
        return dict.fromkeys(VARIANTS, sigmas[0])
    return {
        variant: min(sigmas, key=lambda sigma, variant=variant: scene.track(variant, sigma).vertex_mm)
        for variant in VARIANTS
    }


def compare(scenes: Sequence[MosaicSequence], sigmas: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
    """Results (scenes, 4) of each variant, in the order of the fields of `Result`."""
    found: dict[str, list[tuple[float, ...]]] = {variant: [] for variant in sigmas}
    for scene in scenes:
        for variant, sigma in sigmas.items():  # in turn, so that a change of the machine's speed affects all
            found[variant].append(astuple(scene.track(variant, sigma)))
    return {variant: np.array(results) for variant, results in found.items()}


def run(settings: Settings, context: Context) -> Findings:
    """Compares the variants in every colour order, and in the first one out of focus."""
    cases = {order: (order, 0.0, 0.0) for order in settings.orders}
    if any(settings.blur):
        cases[f"{settings.orders[0]}, blurred"] = (settings.orders[0], *settings.blur)
    goals: list[Goal] = []
    rows: list[tuple[Cell, ...]] = []
    values: dict[str, object] = {}
    for name, optics in cases.items():
        context.progress(name)
        scenes = [
            MosaicSequence(context.seed + 1 + k, settings.frames, *optics, settings.vertices)
            for k in range(settings.sequences)
        ]
        # A seed of its own: σ is not selected on the sequences that it is evaluated on.
        sigmas = select_sigmas(
            MosaicSequence(context.seed, settings.frames, *optics, settings.vertices), settings.sigmas
        )
        found = compare(scenes, sigmas)
        rows += [_row(name, variant, sigmas[variant], results, found) for variant, results in found.items()]
        goals.append(_goal(name, found))
        values[name] = {variant: {"sigma": sigmas[variant], "results": found[variant]} for variant in found}
    return Findings(tuple(goals), (Section("Errors and time", (Table("Variants", _COLUMNS, tuple(rows)),)),), values)


_COLUMNS = (
    Column("order"),
    Column("variant"),
    Column("σ", format=".0f"),
    Column("vertex error (seeds)", "mm"),
    Column("along the surface", "mm", ".3f"),
    Column("surface error", "mm", ".3f"),
    Column("CPU", "ms", ".0f"),
    Column("of direct", format=".2f"),
)


def _row(
    case: str, variant: str, sigma: float, results: NDArray[np.float64], found: Mapping[str, NDArray[np.float64]]
) -> tuple[Cell, ...]:
    vertex, along, surface, cpu = (float(mean) for mean in results.mean(axis=0))
    each = ", ".join(f"{value:.3f}" for value in results[:, 0])
    times = cpu / float(found["direct"][:, 3].mean())
    return (case, variant, sigma, f"{vertex:.3f} ({each})", along, surface, cpu, times)


def _goal(case: str, found: Mapping[str, NDArray[np.float64]]) -> Goal:
    vertex_mm = {variant: float(results[:, 0].mean()) for variant, results in found.items()}
    best = min(vertex_mm[variant] for variant in CODES)
    reason = "Where the optics blur the fine detail, demosaicing has none to lose." if "blurred" in case else ""
    return at_most(f"{case}: vertex error, direct / the best demosaiced", vertex_mm["direct"] / best, 1.0, "", reason)

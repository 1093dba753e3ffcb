"""Noise calibration of simulated walls and of the static parts of real sequences, and consistency of a sensor's own σ.

Real data are sl_rgbd_deform_petit (frames 200 to 319 of a PrimeSense-type sensor; hands squeeze a toy on a table) and
tof_ifm_o3r (one frame of an ifm O3R); without them there are the simulated walls alone.

Statistic: 99th percentile over all pixels of the error of σ and of μ, of every head.
Goals: 10 % and 1 mm; nothing is known of the real sensors, so they are reported without a goal.
Seeds: of the walls, from their distance and material; the context's is not used.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.noise import measurement, sigma_consistency
from abs_service.calibration.shots import sequences
from abs_service.report.content import Cell, Column, Section, Table
from calib.camera import Camera
from calib.noise.base import pixels_where
from calib.noise.per_pixel import PerPixel
from calib.sequences import plane_residuals
from calib.sequences.static import Static, reduce
from drivers.contract.frame import Frame, Kind
from drivers.image_folder.images import DepthImages, ImageFolder
from drivers.image_folder.listing import by_number
from drivers.o3r.buffers import O3rBuffers
from drivers.simulated.address import parse
from evaluation.experiment import Context, Findings, Goal, at_most

#: The paper's calibration (5.1): distances [m] and reflectivities of the simulated walls.
DISTANCES, MATERIALS = (0.7, 1.0, 1.3, 1.6, 1.9), (0.9, 0.5, 0.3)

#: Systematic errors of the simulated heads, as keys of their addresses.
HEADS = {
    "tof, no systematic error": "sensors=tof&tof=176x144",
    "tof, offset, dark and wiggling": "sensors=tof&tof=176x144&offset=0.02&dark=-8&wiggle=0.002",
    "tof, and a fixed pattern of 3 mm": "sensors=tof&tof=176x144&offset=0.02&dark=-8&wiggle=0.002&pattern=0.003",
    "structured light": "sensors=structured_light&structured_light=320x240",
}

#: Bins of distance [mm], and published standard deviations [mm] in them with moving parts included.
BINS = ((450, 550), (550, 650), (650, 800), (800, 1000), (1000, 1300), (1300, 1700), (2200, 2800), (2800, 3500))
WITH_MOTION = (0.41, 0.50, 0.85, 3.68, 2.00, 2.33, 8.70, 12.27)

PETIT = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)


def walls(query: str, count: int) -> tuple[measurement.NoiseCalibration, Any]:
    """Calibrates on walls at known distances, turned by 4°, with `count` frames of each; returns the true head too."""
    found, depths, head = [], [], None
    for depth in DISTANCES:
        for number, reflectivity in enumerate(MATERIALS):
            seed = round(100 * depth) + number
            uri = f"simulated://wall?distance={depth}&reflectivity={reflectivity}&tilt=4&seed={seed}&{query}"
            simulation = parse(uri).build()
            ((name, head),) = simulation.heads.items()
            frames = (frame for k in range(count) for frame in simulation.frames(k))
            found += sequences.of_frames(f"{depth} m, {reflectivity}", frames, {name: head.camera}, "", count)
            # The head may sit beside the rig's origin, where the wall is as far as the address says.
            depths.append(depth - float(head.camera.center[0]) * math.tan(math.radians(4)))
    region = np.ones(found[0].lengths.shape[1:], bool)
    return measurement.calibrate(found, depths, region, np.random.default_rng(0), lambda text: None), head


def errors(found: measurement.NoiseCalibration, head: Any) -> tuple[float, float, float, float]:
    """Error of σ [%] and of μ [mm] over all pixels of all sequences: 99th percentiles, and root mean squares."""
    sigma, mu = [], []
    for static, reference in zip(found.statics, found.references):
        pixels = np.isfinite(reference.distance)
        x, a, p = reference.distance[pixels], static.brightness[pixels], pixels_where(pixels)
        if hasattr(head.noise, "sigma"):
            pattern = head.pattern[pixels]
            law, offset = head.noise.sigma(x, a), head.noise.mu(x, a) + pattern
            if not isinstance(found.model, PerPixel):
                law, offset = np.hypot(law, head.noise.pattern), offset - pattern
        else:
            law = x**2 * np.sqrt(head.noise.random**2 + head.noise.step**2 / 12)
            law, offset = law * static.rays[..., 2][pixels], np.zeros(len(x))  # the error of z, along the ray
        sigma.append(found.model.deviation(x, a, p) / law - 1)
        mu.append((found.model.mean(x, a, p) - offset) * 1e3)
    s, m = np.abs(np.concatenate(sigma)) * 100, np.abs(np.concatenate(mu))
    return float(np.quantile(s, 0.99)), float(np.quantile(m, 0.99)), _rms(s), _rms(m)


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def petit(data: Path) -> tuple[Static, sequences.Sequence]:
    """The static parts of the real sequence."""
    files = by_number(data / "sl_rgbd_deform_petit", "depth_mm_*.png", 30.0)
    folder = ImageFolder({"depth": DepthImages(files, PETIT, 0.001)})
    (one,) = sequences.of_frames("petit", folder.frames(), folder.cameras, "depth", 120)
    return reduce("petit", one.lengths, one.amplitude, PETIT.rays(), one.along, one.digit, 30), one


def by_distance(static: Static, one: sequences.Sequence) -> list[tuple[float, float, float, int]]:
    """Rows by distance: median deviation of the static pixels' z and of all [mm], share not static, pixels."""
    z = np.sort(one.lengths, axis=0)
    middle = z[(np.isfinite(z).sum(axis=0) - 1).clip(0) // 2, *np.indices(z.shape[1:])] * 1e3
    always = np.isfinite(one.lengths).all(axis=0)
    everything = np.std(one.lengths, axis=0, ddof=1) * 1e3
    found = []
    for low, high in BINS:
        inside = (middle >= low) & (middle < high)
        still = inside & static.still
        temporal = np.median(np.sqrt(static.variance[still]) * static.rays[..., 2][still]) * 1e3
        found.append(
            (float(temporal), float(np.median(everything[inside & always])),
             float(1 - still.sum() / inside.sum()), int(still.sum()))
        )  # fmt: skip
    return found


def o3r(data: Path) -> list[sigma_consistency.SigmaConsistency]:
    """Consistency of the O3R's own σ with residuals from local planes, by distance."""
    buffers = O3rBuffers(data / "tof_ifm_o3r" / "O3RBuffer.data")
    frames = {frame.kind: frame for frame in buffers.frames() if isinstance(frame, Frame)}
    distance, reported_sigma = (frames[kind].si().astype(np.float64) for kind in (Kind.DEPTH, Kind.DEVIATION))
    z = plane_residuals.normalized(distance, reported_sigma, buffers.cameras["depth"].rays())
    found = [sigma_consistency.of_values("all", z)]
    for near, far in ((0.2, 0.5), (0.5, 1.0), (1.0, 1.5), (1.5, 2.0)):
        found.append(sigma_consistency.of_values(f"{near} to {far} m", z[(distance >= near) & (distance < far)]))
    return found


TITLE = "Noise calibration on walls and static parts"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: of each simulated wall.
        heads: names in `HEADS`.
    """

    frames: int = 30
    heads: tuple[str, ...] = tuple(HEADS)


QUICK = Settings(8, ("tof, offset, dark and wiggling",))

_WALLS = (
    Column("sensor"), Column("model"), Column("error of σ, 99 %", "%", ".1f"), Column("error of μ, 99 %", "mm", ".2f"),
    Column("error of σ, rms", "%", ".1f"), Column("error of μ, rms", "mm", ".2f"), Column("within σ", "", ".3f"),
    Column("within 1.96 σ", "", ".3f"), Column("fixed pattern", "mm", ".2f"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Calibrates every simulated head, and measures the real data in the data folder."""
    rows: list[tuple[Cell, ...]] = []
    goals: list[Goal] = []
    values = {}
    for name in settings.heads:
        context.progress(name)
        found, head = walls(HEADS[name], settings.frames)
        values[name] = sigma, mu, sigma_rms, mu_rms = errors(found, head)
        fixed = float(np.median([row.fixed for _, row in found.rows])) * 1e3
        fit = found.chosen.quality
        model = found.chosen.candidate.name
        rows.append((name, model, sigma, mu, sigma_rms, mu_rms, fit.within_one, fit.within_95, fixed))
        goals.append(at_most(f"{name}: error of σ in 99 % of the pixels", sigma, 10, "%"))
        goals.append(at_most(f"{name}: error of μ in 99 % of the pixels", mu, 1, "mm"))
    sections = [Section("Simulated walls", (Table("Errors over all pixels and sequences", _WALLS, tuple(rows)),))]
    if context.data is not None and (context.data / "sl_rgbd_deform_petit").is_dir():
        context.progress("static parts of the real sequence")
        sections.append(_petit_section(context.data))
    if context.data is not None and (context.data / "tof_ifm_o3r").is_dir():
        sections.append(_o3r_section(context.data))
    return Findings(tuple(goals), tuple(sections), values)


def _petit_section(data: Path) -> Section:
    static, one = petit(data)
    growth_mm, digit_mm = static.steps.growth * 1e3, static.steps.digit * 1e3
    steps = f"Quantisation steps: {growth_mm:.2f} mm at 1 m, ∝ x²; digits of {digit_mm:.2g} mm."
    columns = (
        Column("z", "mm"), Column("static σ", "mm", ".2f"), Column("with motion, published", "mm", ".2f"),
        Column("with motion, here", "mm", ".2f"), Column("not static", "", ".0%"), Column("pixels"),
    )  # fmt: skip
    rows = tuple(
        (f"{low} to {high}", still, published, moving, share, n)
        for (low, high), published, (still, moving, share, n) in zip(BINS, WITH_MOTION, by_distance(static, one))
    )
    return Section("Static parts of a real sequence", (steps, Table("Standard deviation of z", columns, rows)))


def _o3r_section(data: Path) -> Section:
    columns = (
        Column("distance"), Column("pixels"), Column("within σ", "", ".3f"), Column("within 1.96 σ", "", ".3f"),
        Column("residual / stated σ", "", ".2f"),
    )  # fmt: skip
    rows = tuple((one.name, one.pixels, one.within_one, one.within_95, one.ratio) for one in o3r(data))
    return Section("ifm O3R: consistency of the sensor's own σ", (Table("By distance", columns, rows),))

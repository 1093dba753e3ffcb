"""E1: value of a noise model per pixel on ten geometries, compared with the Cramér–Rao bound.

Statistic: error of the control points (root mean square over 16 points) of every frame but the first; the ratio
Euclidean / likelihood of its means, one ratio a geometry; mean and standard deviation over the geometries.
Goals: ratio ≥ 1.92, the paper's; likelihood's error over the bound ≤ 1.3, from the pixels that vertices read and from
all pixels; ratio ≥ 1.92 with all that makes it easier undone (`assumptions`), added on 2026-11-23 before that was
run for the first time.
Seeds: one sequence of every geometry is judged, two further ones of 20 frames are reported.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from abs_service.tracker.objectives.likelihood import OUTLINE_PX
from evaluation.experiment import Context, Findings
from evaluation.paper.geometries import assumptions, findings
from evaluation.paper.geometries.bound import Priors
from evaluation.paper.geometries.known_sheet import KnownSheet
from evaluation.paper.geometries.measuring import (
    BOTH,
    EUCLIDEAN,
    LIKELIHOOD,
    PAPER,
    Job,
    SequenceResult,
    Variant,
    measure,
)
from evaluation.paper.geometries.sensor import calibrated, true_sensor
from evaluation.scenes.geometries import GEOMETRIES, Motion, MovingSheet
from evaluation.scenes.printed_sheet import random_print

TITLE = "E1: ten geometries, Euclidean fitness against likelihood and against the Cramér–Rao bound"

#: Deviation of a prior that is switched off.
OFF = 100.0

#: Priors of a mesh of 5000 vertices, scaled for its larger number of edges.
FINE = Priors(stretch=BOTH.stretch * (5000 / 600) ** 0.5, speed=BOTH.speed)

#: Other deviations of the stretch prior: that of the built-in rig, and one as far on the other side.
OTHERS = (0.02, 0.04)


@dataclass(frozen=True, slots=True)
class Settings:
    """Size of the experiment.

    Attributes:
        geometries: how many of them.
        frames: of every geometry.
        seeds: sequences of every geometry, with another print, swaying and noise.
        repeat_frames: of the sequences of all seeds but the first.
        prior_frames: with each prior switched off.
        undone_frames: with each of what makes it easier undone.
        mesh_frames: with other meshes: vertices at the rim, a vertex for every pixel.
        search_frames: with the paper's search.
        search_geometries: how many geometries that is done for.
        bound_frames: for which bounds are computed, of every geometry.
        calibration_frames: of every static sequence.
        processes: that work at the same time.
    """

    geometries: int = 10
    frames: int = 500
    seeds: int = 3
    repeat_frames: int = 20
    prior_frames: int = 30
    undone_frames: int = 150
    mesh_frames: int = 40
    search_frames: int = 4
    search_geometries: int = 1
    bound_frames: int = 2
    calibration_frames: int = 30
    processes: int = 2


QUICK = Settings(
    geometries=2, frames=14, seeds=1, repeat_frames=0, prior_frames=6, undone_frames=6, mesh_frames=5, search_frames=0,
    search_geometries=0, bound_frames=1, calibration_frames=8, processes=1,
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Calibrates the camera, tracks all sequences, and compares."""
    generator = np.random.default_rng(context.seed)
    sensor = true_sensor(generator)
    context.progress("calibrating the camera")
    noises = calibrated(sensor, settings.calibration_frames, generator)
    motion = Motion()
    jobs = []
    for seed in range(settings.seeds):
        for number, name in enumerate(list(GEOMETRIES)[: settings.geometries]):
            draws = np.random.default_rng((context.seed, seed, number))
            sheet = MovingSheet(GEOMETRIES[name], motion, draws.uniform(size=3))
            frames = settings.frames if seed == 0 else settings.repeat_frames
            variants = _variants(settings, number) if seed == 0 else _main(frames)
            at = np.linspace(1, frames - 1, settings.bound_frames if seed == 0 else 1).astype(int)
            known = KnownSheet(motion.width, motion.distance)
            noise_seed, texture = int(draws.integers(2**31)), random_print(draws)
            jobs.append(Job(name, noise_seed, sheet, sensor, texture, noises, known, variants, tuple(at)))
    sequences = []
    for done, one in enumerate(_measured(jobs, settings.processes), start=1):
        sequences.append(one)
        context.progress(f"{one.job.name}, {done} of {len(jobs)} sequences")
    return findings.findings(sequences[: settings.geometries], sequences[settings.geometries :])


def _main(frames: int) -> dict[str, Variant]:
    """The two compared variants."""
    return {LIKELIHOOD: Variant(True, frames), EUCLIDEAN: Variant(False, frames)}


def _variants(settings: Settings, number: int) -> dict[str, Variant]:
    """Variants of the first sequence of a geometry."""
    variants = _main(settings.frames)
    for kind, likelihood in ((LIKELIHOOD, True), (EUCLIDEAN, False)):
        n = settings.prior_frames
        for deviation in OTHERS:
            name = f"{kind}, stretch prior of {deviation}"
            variants[name] = Variant(likelihood, settings.frames, Priors(deviation, BOTH.speed))
        variants[f"{kind}, no stretch prior"] = Variant(likelihood, n, Priors(OFF, BOTH.speed))
        variants[f"{kind}, no motion prior"] = Variant(likelihood, n, Priors(BOTH.stretch, OFF))
        variants[f"{kind}, neither prior"] = Variant(likelihood, n, Priors(OFF, OFF))
        for condition in assumptions.CONDITIONS:
            variants[f"{kind}, {condition.name}"] = Variant(
                likelihood, settings.undone_frames, noise=condition.noise, rest=condition.rest
            )
        n = settings.mesh_frames
        variants[f"{kind}, vertices at the rim"] = Variant(likelihood, n, inset=0.0)
        variants[f"{kind}, a vertex for every pixel"] = Variant(likelihood, n, FINE, 5000)
        if number < settings.search_geometries:
            variants[f"{kind}, CMA-ES 1000 × 32"] = Variant(likelihood, settings.search_frames, optimizer=PAPER)
    variants[f"{LIKELIHOOD}, with the outline"] = Variant(True, settings.mesh_frames, outline_px=OUTLINE_PX)
    return variants


def _measured(jobs: Iterable[Job], processes: int) -> Iterator[SequenceResult]:
    if processes == 1:
        yield from map(measure, jobs)
        return
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        yield from pool.map(measure, jobs)

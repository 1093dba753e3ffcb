"""Favourable assumptions of E1, each undone: what they contribute to the ratio."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Cell, Column, Section, Table
from evaluation.paper.geometries import sensor
from evaluation.paper.geometries.measuring import EUCLIDEAN, LIKELIHOOD, SequenceResult
from evaluation.scenes.printed_sheet import REST


@dataclass(frozen=True, slots=True)
class Condition:
    """One of the favourable assumptions undone, or all.

    Attributes:
        name: in the table, and behind the fitness in `Job.variants`.
        noise: calibration, see `sensor`.
        rest: exposures that the first frame is the mean of.
    """

    name: str
    noise: str
    rest: int


#: All three at once.
ALL = Condition("all three undone", sensor.BOTH, 1)

CONDITIONS = (
    Condition("offsets as fitted", sensor.OFFSETS, REST),
    Condition("first frame of one exposure", sensor.PLAIN, 1),
    Condition("polynomials as law", sensor.POLYNOMIAL, REST),
    ALL,
)

_SAID = (
    "Three things make this easier than a camera on a table. The calibration's mean offsets of single pixels are set "
    "to zero, because the camera has none: as fitted, they are noise. The first frame, from which the grey appearance "
    f"is taken, is the mean of {REST} exposures. The law of σ has the form of the truth, σ₀ + c / amplitude. Each is "
    "undone below, over the same frames: offsets as fitted; a first frame of one exposure; polynomials of degree "
    f"{sensor.DEGREES[0]} in the distance and {sensor.DEGREES[1]} in the amplitude as law, as in the paper. The "
    "Euclidean fitness has no noise model, so only the first frame concerns it."
)


def ratios(first: Sequence[SequenceResult], condition: Condition) -> NDArray[np.float64]:
    """Euclidean / likelihood, mean errors of the control points, of every geometry (n,) under a condition."""
    errors = _errors(first, f", {condition.name}", "control", None)
    return errors[0] / errors[1]


def section(first: Sequence[SequenceResult]) -> Section:
    """The assumptions, and a table of the ratio with each of them undone.

    Args:
        first: the first sequence of every geometry.
    """
    columns = (
        Column("condition"), Column("frames", "", ".0f"), Column("Euclidean", "mm", ".2f"),
        Column("likelihood", "mm", ".2f"), Column("ratio", "", ".2f"), Column("SD over geometries", "", ".2f"),
        Column("ratio, surface", "", ".2f"),
    )  # fmt: skip
    frames = len(first[0].followed[f"{LIKELIHOOD}, {ALL.name}"].control)
    rows: list[tuple[Cell, ...]] = []
    for title, suffix in {"as above": "", **{one.name: f", {one.name}" for one in CONDITIONS}}.items():
        control, surface = (_errors(first, suffix, part, frames) for part in ("control", "surface"))
        ratio, of_surface = control[0] / control[1], surface[0] / surface[1]
        spread = float(np.std(ratio, ddof=1)) if len(ratio) > 1 else float("nan")
        means = (float(control[0].mean()), float(control[1].mean()), float(ratio.mean()))
        rows.append((title, float(frames * len(first)), *means, spread, float(of_surface.mean())))
    table = Table("Mean errors of the control points, and ratios of means of every geometry", columns, tuple(rows))
    return Section("What makes it easier, undone", (_SAID, table))


def _errors(first: Sequence[SequenceResult], suffix: str, part: str, frames: int | None) -> NDArray[np.float64]:
    """Mean errors (2, geometries) [mm] of the Euclidean fitness and the likelihood over the first frames."""
    return np.array(
        [
            [np.mean(getattr(one.followed[f"{kind}{suffix}"], part)[:frames]) for one in first]
            for kind in (EUCLIDEAN, LIKELIHOOD)
        ]
    )

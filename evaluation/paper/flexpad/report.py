"""Tables and pictures of E2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Column, Picture, Section, Table, drawing
from abs_service.report.plots import figure
from drivers.contract.frame import Kind
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import TrackedSequence


@dataclass(frozen=True, eq=False)
class Errors:
    """Parameters of a sequence, found and true.

    Attributes:
        found, true: bends (frames, 8).
        height: height map's parameter (frames,), in truth 0.
        rotation_mrad, translation_mm: mean errors of the pose.
    """

    found: NDArray[np.float64]
    true: NDArray[np.float64]
    height: NDArray[np.float64]
    rotation_mrad: float
    translation_mm: float

    @cached_property
    def bend(self) -> float:
        """Root mean square of the errors of all bends."""
        return float(np.sqrt(np.mean((self.found - self.true) ** 2)))


@dataclass(frozen=True, eq=False)
class Tracked:
    """One sequence.

    Attributes:
        name: of the sequence.
        deviation: mean of the sensor on the sheet at first [m].
        followed: by fitness function.
        errors: of Θ, likewise.
    """

    name: str
    deviation: float
    followed: Mapping[str, TrackedSequence]
    errors: Mapping[str, Errors]

    def figures(self, fitness: str) -> dict[str, float]:
        """Statistics of a fitness function, by name."""
        followed, errors = self.followed[fitness], self.errors[fitness]
        return {
            "bend": errors.bend,
            "height": float(np.sqrt(np.mean(errors.height**2))),
            "rotation_mrad": errors.rotation_mrad,
            "translation_mm": errors.translation_mm,
            "vertex_mm": followed.vertex_mm,
            "surface_mm": followed.surface_mm,
            "median_ms": followed.median_ms,
        }


#: Names of the figures with their columns.
COLUMNS: Mapping[str, Column] = {
    "bend": Column("bends, rms", "", ".3f"),
    "height": Column("height map, rms", "", ".3f"),
    "rotation_mrad": Column("rotation", "mrad", ".1f"),
    "translation_mm": Column("translation", "mm", ".2f"),
    "vertex_mm": Column("vertex", "mm", ".2f"),
    "surface_mm": Column("surface", "mm", ".2f"),
    "median_ms": Column("time", "ms", ".0f"),
}


def ratios(tracked: Sequence[Tracked], fitness: str, figure_: str) -> list[float]:
    """A figure's ratio to that of the likelihood, of every sequence."""
    return [one.figures(fitness)[figure_] / one.figures("likelihood")[figure_] for one in tracked]


def values(tracked: Sequence[Tracked]) -> dict[str, Any]:
    """Numbers for programs."""
    return {one.name: {fitness: one.figures(fitness) for fitness in one.followed} for one in tracked}


def sections(
    tracked: Sequence[Tracked], budgets: Mapping[str, Tracked], exposures: Sequence[LabeledExposure]
) -> tuple[Section, ...]:
    """The evidence; `exposures` are those of the first sequence, which `budgets` compares searches on."""
    about = (
        "Each sheet rolls onto a cylinder in one of FlexPad's four directions while it moves; two of the eight bends "
        "are not 0. The Euclidean fitness has the deviation that the sensor has on the sheet on average, counts every "
        "residual up to 10 cm as its square and, where it is bounded, none for more than an outlier of the likelihood."
    )
    found = Section("Errors", (_means(tracked), _sequences(tracked), _course(tracked[0])))
    searched = [Section("Budget", (_budgets(budgets),))] if budgets else []
    return Section("The scene", (about, _scene(exposures))), found, *searched


def _means(tracked: Sequence[Tracked]) -> Table:
    columns = (
        Column("fitness"),
        *COLUMNS.values(),
        Column("surface / likelihood's", "", ".2f"),
        Column("SD", "", ".2f"),
        Column("smallest", "", ".2f"),
    )
    rows = []
    for fitness in tracked[0].followed:
        means = [float(np.mean([one.figures(fitness)[name] for one in tracked])) for name in COLUMNS]
        of_surface = ratios(tracked, fitness, "surface_mm")
        rows.append((fitness, *means, float(np.mean(of_surface)), float(np.std(of_surface)), min(of_surface)))
    return Table(f"Errors of Θ and of the mesh, means of {len(tracked)} sequences", columns, tuple(rows))


def _sequences(tracked: Sequence[Tracked]) -> Table:
    names = tracked[0].followed
    columns = (
        Column("sequence"), Column("σ", "mm", ".1f"), Column("largest bend", "", ".2f"),
        *(Column(f"bends, {name}", "", ".3f") for name in names),
        *(Column(f"surface, {name}", "mm", ".2f") for name in names),
    )  # fmt: skip
    rows = tuple(
        (
            one.name, one.deviation * 1e3, float(np.abs(one.errors["likelihood"].true).max()),
            *(one.figures(name)["bend"] for name in names), *(one.figures(name)["surface_mm"] for name in names),
        )
        for one in tracked
    )  # fmt: skip
    return Table("Every sequence", columns, rows)


def _budgets(budgets: Mapping[str, Tracked]) -> Table:
    columns = (Column("search"), Column("fitness"), *COLUMNS.values())
    rows = tuple(
        (search, fitness, *one.figures(fitness).values()) for search, one in budgets.items() for fitness in one.followed
    )
    return Table("The first sequence's first frames, by two searches", columns, rows)


def _course(one: Tracked) -> Picture:
    drawn = figure(10, 3.2)
    names = ("Euclidean", "likelihood")
    for axes, name in zip(drawn.subplots(1, len(names), sharey=True), names):
        errors = one.errors[name]
        bent = np.any(errors.true != 0, axis=0)
        axes.plot(errors.found[:, ~bent], color="0.7", lw=0.8)
        axes.plot(errors.found[:, bent], color="tab:blue", lw=1)
        axes.plot(errors.true[:, bent], color="black", lw=1, ls="--")
        axes.set(title=name, xlabel="frame", ylabel="bend")
    return drawing(
        drawn,
        f"The eight bends of sequence {one.name}: true (dashed), found (blue), and those that are 0 in truth (grey).",
        "With the likelihood the bends follow the true ones closely",
    )


def _scene(exposures: Sequence[LabeledExposure]) -> Picture:
    drawn = figure(8, 3.2)
    images = {frame.kind: frame.si() for frame in exposures[len(exposures) // 2].frames.frames.values()}
    for axes, kind, limits in zip(drawn.subplots(1, 2), (Kind.AMPLITUDE, Kind.DEPTH), ((0, 9000), (0.8, 1.7))):
        shown = axes.imshow(images[kind], cmap="gray" if kind == Kind.AMPLITUDE else "viridis_r", clim=limits)
        axes.set(title=kind.value, xticks=(), yticks=())
        drawn.colorbar(shown, ax=axes, label="" if kind == Kind.AMPLITUDE else "m", shrink=0.8)
    return drawing(drawn, "Amplitude and distance of one frame.", "A bent sheet with a print before a wall")

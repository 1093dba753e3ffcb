"""Tables and pictures of E4 and E5."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from abs_service.report import plots
from abs_service.report.content import Column, Picture, Section, Table, drawing
from abs_service.tracker.optimizers import cma_es
from abs_service.tracking.plan import OptimizerSettings
from calib.noise.tof_amplitude import TofAmplitude
from drivers.contract.frame import Kind
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import TrackedSequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Half the width of the band that cross-sections are drawn from, as a share of a board's height.
_BAND = 0.12


@dataclass(frozen=True)
class Published:
    """The largest bend in the paper's Table 1 for FlexPad, mean and standard deviation, by Euclidean and likelihood."""

    euclidean: tuple[float, float]
    likelihood: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of both fitness functions on the same sequences.

    Attributes:
        model: "FlexPad" or "NURBS".
        search: in words.
        unit: of the errors.
        followed: the sequences by fitness function, "Euclidean" and "likelihood".
        errors: of all frames, likewise.
    """

    model: str
    search: str
    unit: str
    followed: Mapping[str, Sequence[TrackedSequence]]
    errors: Mapping[str, NDArray[np.float64]]

    @property
    def frames(self) -> int:
        """Number of frames of all sequences."""
        return len(self.errors["likelihood"])

    @property
    def ratio(self) -> float:
        """Mean error of the Euclidean fitness over that of the likelihood."""
        return float(self.errors["Euclidean"].mean() / self.errors["likelihood"].mean())

    @property
    def values(self) -> dict[str, Any]:
        """Numbers for programs."""
        found = {title: {"mean": e.mean(), "sd": e.std(ddof=1), "max": e.max()} for title, e in self.errors.items()}
        return {**found, "ratio": self.ratio, "unit": self.unit}

    def rows(self) -> list[tuple[str | float, ...]]:
        """One row of the table for each fitness function."""
        return [
            (
                self.model, self.search, title, e.mean(), e.std(ddof=1), float(np.median(e)), e.max(), self.unit or "–",
                float(np.mean([one.surface_mm for one in self.followed[title]])),
                float(np.mean([one.median_ms for one in self.followed[title]])),
                self.ratio if title == "Euclidean" else float("nan"),
            )
            for title, e in self.errors.items()
        ]  # fmt: skip


def search_name(search: OptimizerSettings) -> str:
    """Name of a search, with its budget."""
    if isinstance(search, cma_es.Settings):
        return f"CMA-ES, {search.generations} × {search.population} at most"
    return "hybrid"


def sections(
    board: str,
    published: Published,
    exposures: Sequence[LabeledExposure],
    noise: TofAmplitude,
    compared: Sequence[Comparison],
    by_bias: Mapping[float, Sequence[Comparison]],
) -> tuple[Section, ...]:
    """The evidence.

    Args:
        board: its name.
        published: the paper's figures.
        exposures: the first sequence.
        noise: noise model from the static walls.
        compared: the comparisons; the first ones, one for each model, are drawn.
        by_bias: comparisons with other biases.
    """
    first, middle = _first(compared), len(exposures) // 2
    scene = Section(
        "The scene",
        (
            "Nothing bends. The sensor's error grows with falling amplitude; from 15 static sequences of a wall: "
            f"μ = {noise.mu_amplitude:.3g} m / a, {noise.mu_amplitude / 8.5:.2g} mm on the white and "
            f"{noise.mu_amplitude / 1.5:.2g} mm on the black at 1 m. The likelihood models this, the Euclidean "
            "fitness does not.",
            drawing(
                _scene(exposures[middle], first, middle),
                "One frame: amplitude, and cross-sections of the board along its middle.",
                f"Amplitude image of the {board}, and cross-sections of what was reconstructed of it",
            ),
        ),
    )
    return scene, _errors(published, compared), *([_biases(by_bias)] if by_bias else [])


def _first(compared: Sequence[Comparison]) -> dict[str, Comparison]:
    """The first comparison of each model."""
    models = dict.fromkeys(one.model for one in compared)
    return {model: next(one for one in compared if one.model == model) for model in models}


def _errors(published: Published, compared: Sequence[Comparison]) -> Section:
    columns = (
        Column("model"), Column("search"), Column("fitness"), Column("mean", "", ".3g"), Column("SD", "", ".2g"),
        Column("median", "", ".3g"),
        Column("largest", "", ".3g"), Column("unit"), Column("surface error", "mm", ".2f"),
        Column("time", "ms", ".1f"), Column("Euclidean / likelihood", "", ".2f"),
    )  # fmt: skip
    caption = "Deviation from flat: FlexPad's largest |bend|; mean distance of the NURBS' control points from a plane"
    rows = tuple(row for one in compared for row in one.rows())
    paper = (
        ("FlexPad", "Euclidean", *published.euclidean, published.euclidean[0] / published.likelihood[0]),
        ("FlexPad", "likelihood", *published.likelihood, float("nan")),
    )
    said = Table(
        "The paper's Table 1, real boards before an SR4000",
        (Column("model"), Column("fitness"), Column("mean"), Column("SD"), Column("ratio", "", ".2f")),
        paper,
    )
    note = (
        "A bend of 2 is a radius of 0.1 m here; the paper does not define its unit, so only the ratios can be "
        "compared. The paper's means for NURBS are missing in its text. Times are processor time of a whole frame."
    )
    return Section("Errors", (Table(caption, columns, rows), said, note, _course(compared)))


def _course(compared: Sequence[Comparison]) -> Picture:
    figure = plots.figure(10, 3.2)
    first = _first(compared)
    for axes, one in zip(figure.subplots(1, len(first)), first.values()):
        for title, errors in one.errors.items():
            axes.plot(errors, lw=0.8, label=title)
        axes.set(
            title=one.model,
            xlabel="frame",
            ylabel="deviation from flat" + (f" [{one.unit}]" if one.unit else ""),
            ylim=(0, None),
        )
        axes.legend()
    return drawing(figure, "Deviation from flat, frame by frame.", "The Euclidean fitness is above the likelihood")


def _biases(by_bias: Mapping[float, Sequence[Comparison]]) -> Section:
    columns = [Column("bias × amplitude", "m", "g")]
    rows = []
    for bias, compared in sorted(by_bias.items(), reverse=True):
        cells = [(one.errors["Euclidean"].mean(), one.errors["likelihood"].mean(), one.ratio) for one in compared]
        rows.append((bias, *np.concatenate(cells).tolist()))
    for one in next(iter(by_bias.values())):
        columns += [
            Column(f"{one.model}, Euclidean", one.unit, ".3g"), Column("likelihood", one.unit, ".3g"),
            Column("ratio", "", ".2f"),
        ]  # fmt: skip
    return Section("Other biases", (Table("Mean deviation from flat", tuple(columns), tuple(rows)),))


def _scene(exposure: LabeledExposure, first: Mapping[str, Comparison], number: int) -> "Figure":
    images = {frame.kind: frame.si() for frame in exposure.frames.frames.values()}
    figure = plots.figure(12, 3.4)
    amplitude, *profiles = figure.subplots(1, 1 + len(first), width_ratios=(1, *[1.2] * len(first)))
    amplitude.imshow(images[Kind.AMPLITUDE], cmap="gray", vmax=9000)
    amplitude.set(title="amplitude", xticks=(), yticks=())
    for axes, one in zip(profiles, first.values()):
        for title, runs in one.followed.items():
            axes.plot(*_section(runs[0].estimates[number].vertices, exposure.points), ".", ms=4, label=title)
        axes.axhline(0, color="0.3", lw=0.8, label="truth")
        axes.set(title=one.model, xlabel="along the board [mm]", ylabel="towards the sensor [mm]")
        axes.legend(fontsize="small")
    return figure


def _section(
    vertices: NDArray[np.floating], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places along the true board, and heights above it [mm], of the vertices (n, 3) near its middle line."""
    center = points.mean(axis=(0, 1))
    along, down = points[0, -1] - points[0, 0], points[-1, 0] - points[0, 0]
    x, y = along / np.linalg.norm(along), down / np.linalg.norm(down)
    arms = vertices - center
    near = np.abs(arms @ y) < _BAND * np.linalg.norm(down)
    return arms[near] @ x * 1e3, -arms[near] @ np.cross(x, y) * 1e3

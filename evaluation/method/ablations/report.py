"""Tables and pictures of the ablations."""

from collections.abc import Mapping, Sequence

import numpy as np

from abs_service.report import plots
from abs_service.report.content import Column, Picture, Table, drawing
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import TrackedSequence, effort


def figures(runs: Sequence[TrackedSequence]) -> dict[str, float]:
    """Statistics of some sequences, by name."""
    vertex = [one.vertex_mm for one in runs]
    return {
        "vertex_mm": float(np.mean(vertex)),
        "vertex_sd_mm": float(np.std(vertex)),
        "surface_mm": float(np.mean([one.surface_mm for one in runs])),
        **effort(runs),
        "residual_variance": float(
            np.mean([e.fits[0].normalized_residual ** 2 for one in runs for e in one.estimates if e.fits])
        ),
    }


def table(caption: str, lines: Mapping[str, Sequence[TrackedSequence]]) -> Table:
    """One line for each variant."""
    columns = (
        Column(""), Column("vertex", "mm", ".2f"), Column("SD of the sequences", "mm", ".2f"),
        Column("surface", "mm", ".2f"), Column("worst frame", "mm", ".1f"), Column("evaluations", "", ".0f"),
        Column("time", "ms", ".0f"), Column("TRACKING", "", ".0%"), Column("variance of depth residuals", "", ".2f"),
    )  # fmt: skip
    return Table(caption, columns, tuple((name, *figures(runs).values()) for name, runs in lines.items()))


def curves(found: Mapping[str, Mapping[str, Sequence[TrackedSequence]]]) -> Picture:
    """Errors over what is counted, for all questions whose variants are numbers."""
    counted = [title for title, lines in found.items() if all(name.isdigit() for name in lines)]
    drawn = plots.figure(11, 3.2)
    for axes, title in zip(drawn.subplots(1, len(counted)), counted):
        counts = [int(name) for name in found[title]]
        for name, mark in (("vertex_mm", "o-"), ("surface_mm", "s--")):
            axes.plot(counts, [figures(runs)[name] for runs in found[title].values()], mark, ms=4, label=name[:-3])
        axes.set(xscale="log", xlabel=title, ylabel="error [mm]", ylim=(0, None))
        axes.grid(color="0.9")
        axes.legend()
    return drawing(drawn, "Error against the size of each part.", "Errors fall and level off")


def scene(exposures: Sequence[LabeledExposure]) -> Picture:
    """Images of the sensors at the end of a sequence."""
    drawn = plots.figure(9, 3.2)
    frames = exposures[-1].frames.frames
    for axes, key in zip(drawn.subplots(1, 3), (("tof", "depth"), ("tof", "amplitude"), ("color", "color"))):
        image = frames[key].data
        axes.imshow(image, cmap="gray" if key[1] == "amplitude" else "viridis_r")
        axes.set(title=f"{key[0]}/{key[1]}", xticks=(), yticks=())
    return drawing(drawn, "The last moment of the first sequence.", "A bent sheet before a wall")

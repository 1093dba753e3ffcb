"""Tables and pictures of the comparison with peers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from abs_service.report import plots
from abs_service.report.content import Column, Picture, Section, Table, drawing
from evaluation.method.peers.measuring import LOST_FRAMES, LOST_M, TrackedRun
from evaluation.scenes.bent_sheet import CAMERA, INTERVAL_S, SheetScene

Rows = Mapping[str, Sequence[TrackedRun]]

_COLUMNS = (
    Column("tracker"), Column("time, median", "ms", ".2f"), Column("95 %", "ms", ".2f"),
    Column("vertex error", "mm", ".2f"), Column("SD of seeds", "mm", ".2f"), Column("worst frame", "mm", ".1f"),
    Column("surface error", "mm", ".2f"), Column("worst frame", "mm", ".2f"),
)  # fmt: skip

#: How the row that does not track is called.
_NO_TRACKING = "none"

_TITLES = {
    "5 mm": "Bending to ±120°, 5 mm noise",
    "15 mm": "The same, 15 mm noise",
    "hole": "The same with a hole of the size of a hand, 45 × 22 pixels, 5 mm noise",
    "turn": "Turning by 90° about the vertical axis in 0.25 s",
    "spin": "Turning by 90° about the line of sight in 0.25 s",
}

#: What has to be said of some scenes.
_ABOUT = {
    "hole": (
        "Nobody tells ours of the hole. Gauss–Newton is here twice: once it takes the hole for what is beside the "
        "sheet; once it is told which pixels the hole has. Point sets are the points that were measured.",
    ),
    "turn": ("The sheet keeps its bend while it turns, so that rigid registration has the right model here.",),
    "spin": ("The sheet keeps its bend while it turns, so that rigid registration has the right model here.",),
}


def sections(
    scenes: Mapping[str, SheetScene],
    found: Mapping[str, Rows],
    repeated: Mapping[str, Rows],
    leapt: Rows,
    missing: Sequence[str],
    slow: Sequence[str],
) -> tuple[Section, ...]:
    """The evidence.

    Args:
        scenes: by name.
        found: what every tracker made of every scene.
        repeated: what some made of sequences with other seeds.
        leapt: what some made of sheets that leapt.
        missing: packages that are not installed.
        slow: competitors that follow a few frames only.
    """
    said = [
        "A sheet of 300 × 200 mm, about 1 m before a depth camera of 176 × 144 pixels (f = 183 pixels), rendered at "
        "30 Hz; a wall 60 cm behind it. All begin with the same 20 × 20 vertices (FlexPad: its own grid of about "
        "as many) where they really are in the first frame, and each frame with what they found in the last. "
        "Point-set methods and Gauss–Newton are told which pixels show the sheet; ours tell that themselves. Times "
        "are processor times of all threads from the depth image, or the points, to the vertices; ours include the "
        "covariances and the verdict on the estimate. Gauss–Newton has 5 × 4 control points of degree 3, is compiled "
        "like ours, begins at the last result and stops by the rule of our descent (at most 12 steps; a step that "
        "promises less than 0.01 nats per parameter is the last one), or after six steps as until 2026-11-25. Every "
        "tracker follows every sequence once. Ours has the defaults of a user, but for what a template adds: a sheet "
        "that is lost stays the same sheet. Vertex error: distance of every vertex from its own material; surface "
        "error: from the nearest point of the surface."
    ]
    if missing:
        said.append(f"Cannot be imported here, so left out: {', '.join(missing)} (see docs/reference/evaluation.md).")
    if slow:
        said.append(f"Tracked ten frames of one seed only, because they take so long: {', '.join(slow)}.")
    about = Section("What is compared", tuple(said))
    return (
        about,
        *(
            Section(
                _TITLES[name],
                (*_ABOUT.get(name, ()), _table(_TITLES[name], rows), _curves(name, rows), _worst(scenes[name], rows)),
            )
            for name, rows in found.items()
        ),
        _other_seeds(repeated),
        _leaps(leapt),
    )


def values(rows: Rows) -> dict[str, Any]:
    """Numbers of one scene for programs."""
    return {
        title: dict(
            zip(
                (
                    "ms",
                    "ms_p95",
                    "vertex_mm",
                    "vertex_sd_mm",
                    "vertex_max_mm",
                    "surface_mm",
                    "surface_max_mm",
                ),
                _row(runs),
            )
        )
        for title, runs in rows.items()
    }


def losses(leapt: Rows) -> dict[str, Any]:
    """Numbers of the leaps for programs."""
    return {
        title: {"lost": sum(one.lost for one in runs), "leaps": len(runs), "frames": [one.far for one in runs]}
        for title, runs in leapt.items()
    }


def _row(runs: Sequence[TrackedRun]) -> tuple[float, ...]:
    ms = np.concatenate([one.cpu_ms for one in runs])
    vertex = [one.vertex_mm.mean() for one in runs]
    return (
        float(np.median(ms)), float(np.quantile(ms, 0.95)),
        float(np.mean(vertex)), float(np.std(vertex, ddof=1)) if len(vertex) > 1 else float("nan"),
        float(max(one.vertex_mm.max() for one in runs)),
        float(np.mean([one.surface_mm.mean() for one in runs])), float(max(one.surface_mm.max() for one in runs)),
    )  # fmt: skip


def _table(caption: str, rows: Rows) -> Table:
    return Table(caption, _COLUMNS, tuple((title, *_row(runs)) for title, runs in rows.items()))


def _other_seeds(repeated: Mapping[str, Rows]) -> Section:
    rows = tuple(
        (name, title, len(runs), *_row(runs)) for name, found in repeated.items() for title, runs in found.items()
    )
    text = "Sequences with noise of other seeds, which no goal refers to: what the choice of the seeds is worth."
    columns = (Column("scene"), _COLUMNS[0], Column("sequences"), *_COLUMNS[1:])
    return Section("Other seeds", (text, Table("The same scenes with other seeds", columns, rows)))


def _leaps(leapt: Rows) -> Section:
    columns = (
        Column("tracker"), Column("leaps"), Column("lost"), Column("away, mean", "frames", ".1f"),
        Column("at most", "frames"), Column("vertex error in the end", "mm", ".2f"),
        Column("slowest frame", "ms", ".0f"),
    )  # fmt: skip
    rows = []
    for title, runs in leapt.items():
        rows.append(
            (
                title, len(runs), sum(one.lost for one in runs),
                float(np.mean([one.far for one in runs])), max(one.far for one in runs),
                float(np.mean([one.vertex_mm[-1] for one in runs])), float(max(one.cpu_ms.max() for one in runs)),
            )
        )  # fmt: skip
    text = (
        "After three frames, the sheet is elsewhere, 7 to 13 cm to the side, turned by up to 75° about the line of "
        "sight, tilted and bent otherwise, as if it had been out of sight. It is lost if its vertices are on "
        f"average more than {LOST_M * 1e3:.0f} mm off for more than {LOST_FRAMES} frames."
    )
    return Section("Leaps", (text, Table("Sheets that leap", columns, tuple(rows))))


def _curves(name: str, rows: Rows) -> Picture:
    """Vertex error over time of the first seed."""
    figure = plots.figure(9, 3.2)
    axes = figure.add_subplot()
    for title, runs in rows.items():
        axes.plot(np.arange(1, len(runs[0].vertex_mm) + 1) * INTERVAL_S, runs[0].vertex_mm, label=title)
    axes.set(xlabel="time / s", ylabel="vertex error / mm", yscale="log")
    axes.legend(fontsize="x-small", ncols=2, loc="center left", bbox_to_anchor=(1, 0.5))
    return drawing(figure, "Vertex error over time, first seed", f"Vertex error of every tracker over time: {name}")


def _worst(scene: SheetScene, rows: Rows) -> Picture:
    """Vertices and their material, in the camera's view, in each tracker's worst frame of the first seed."""
    ours, *others = (title for title in rows if not title.startswith(_NO_TRACKING))
    shown = [ours, *others[-5:]]
    figure = plots.figure(2.6 * len(shown), 2.4)
    for place, title in enumerate(shown, start=1):
        one = rows[title][0]
        k = int(np.argmax(one.vertex_mm))
        true = CAMERA.project(scene.motion((k + 1) * INTERVAL_S).points(one.at))
        found = CAMERA.project(one.vertices[k])
        axes = figure.add_subplot(1, len(shown), place)
        axes.plot(*np.stack([true, found], axis=1).transpose(2, 1, 0), color="tab:red", linewidth=0.6, rasterized=True)
        axes.plot(*true.T, ".", color="0.6", markersize=2, rasterized=True)
        axes.plot(*found.T, ".", color="black", markersize=2, rasterized=True)
        axes.set(aspect="equal", xticks=[], yticks=[])
        axes.invert_yaxis()
        axes.set_title(f"{title}\nframe {k + 1}, {one.vertex_mm[k]:.1f} mm", fontsize="xx-small")
    caption = "Each tracker's worst frame: vertices (black), where their material is (grey), and the way between (red)"
    return drawing(figure, caption, f"Found and true vertices in the worst frames: {scene.name}")

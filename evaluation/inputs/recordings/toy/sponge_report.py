"""The sponge of the toy's sequence as findings: residuals, folds, stretch and drift of its mesh."""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from abs_service.report.content import Column, Section, Table
from evaluation.experiment import Findings, Goal, at_most
from evaluation.inputs.recordings.toy import sponge
from evaluation.inputs.recordings.toy.sponge import MeshState
from evaluation.inputs.recordings.toy.toy import Toy, TrackedFrame

#: What is wanted, written before the first run: residuals of the median frame, folds and edges of the worst, and the
#: drift in the last, which is frame 120 of the full experiment.
RESIDUAL_MM, FOLDED, EDGE, DRIFT_PX = 0.6, 0.5, 8.0, 0.7  # the middle two in %

#: Rows of the table: statistic, unit, factor, and whether the largest is the worst.
_ROWS = {
    "forward_mm": ("forward residual", "mm", 1, np.max),
    "backward_mm": ("backward residual", "mm", 1, np.max),
    "off": ("vertices more than 20 mm off the measured surface", "%", 100, np.max),
    "inside": ("vertices inside the mask", "%", 100, np.min),
    "folded": ("folded faces", "%", 100, np.max),
    "edge": ("change of an edge, p95", "%", 100, np.max),
    "drift_px": ("drift of corners", "px", 1, np.max),
    "corners": ("corners", "", 1, np.min),
}

_COLUMNS = (
    Column("statistic"),
    Column("unit"),
    Column("median frame", format=".2f"),
    Column("worst frame", format=".2f"),
    Column("last frame", format=".2f"),
)


def findings(folder: Path, frames: int, progress: Callable[[str], None]) -> Findings:
    """Tracks the sponge.

    Args:
        folder: with the toy's images and the masks sponge_*.png.
        frames: how many of them, from the first on.
        progress: called with the current step.
    """
    toy = Toy(folder, frames, "sponge")
    progress("the sponge")
    tracked = list(toy.follow(time.process_time_ns))
    states = sponge.states(toy.references, tracked)
    table = Table(
        "The sponge's mesh", _COLUMNS, tuple((row[0], row[1], *_cells(states, name)) for name, row in _ROWS.items())
    )
    section = Section("Sponge: is the mesh still the sponge's", (_WHAT, _text(tracked), table))
    values = {field.name: [getattr(state, field.name) for state in states] for field in fields(MeshState)}
    return Findings(_goals(states), (section,), {"sponge": values})


_WHAT = (
    "The toy's sequence and rig; the object is the sponge alone, by its mask in the first frame. Forward and backward "
    "as for the soft toy. Off: farther than 20 mm from the nearest measured point of the sponge in this frame. "
    "Folded: a face that turns to the camera the other side than in the first frame, or that has more than 90° to a "
    "neighbour and had not. Edges are compared with the mesh at rest. Drift: corners of the first image, bound to the "
    "mesh there and tracked by optical flow from image to image (there and back within 0.5 px, inside the sponge's "
    "mask), against the projection of their bound points."
)


def _text(frames: Sequence[TrackedFrame]) -> str:
    took = np.array([frame.solve_ms for frame in frames[1:]])
    tracking = np.mean([frame.tracking for frame in frames])
    return (
        f"{tracking:.1%} of {len(frames)} frames are TRACKING. A frame takes {np.median(took):.1f} ms of one processor "
        f"(95 % take less than {np.quantile(took, 0.95):.1f} ms)."
    )


def _goals(states: Sequence[MeshState]) -> tuple[Goal, ...]:
    forward, backward, folded, edge = (_cells(states, name) for name in ("forward_mm", "backward_mm", "folded", "edge"))
    return (
        at_most("Sponge: forward residual, median", forward[0], RESIDUAL_MM, "mm"),
        at_most("Sponge: backward residual, median", backward[0], RESIDUAL_MM, "mm"),
        at_most("Sponge: folded faces, the worst frame", folded[1], FOLDED, "%"),
        at_most(f"Sponge: drift of corners, frame {len(states)}", states[-1].drift_px, DRIFT_PX, "px"),
        at_most("Sponge: change of an edge, p95, the worst frame", edge[1], EDGE, "%"),
    )


def _cells(states: Sequence[MeshState], name: str) -> tuple[float, float, float]:
    """A statistic in the median, the worst and the last frame, in the unit of its row."""
    _, _, factor, worst = _ROWS[name]
    values = factor * np.array([getattr(state, name) for state in states], float)
    return float(np.median(values)), float(worst(values)), float(values[-1])

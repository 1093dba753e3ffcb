"""The picture of the real sequence: the mesh over the edges of four frames, coloured by its depth residual."""

from pathlib import Path

import cv2
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from tests.evaluation.residuals import vertex_errors
from tests.evaluation.soft_toy import CAMERA, Tracked, distance_of, mask_of, read

#: Part of the image to show: left, right, bottom, top [px].
WINDOW = (60, 170, 165, 55)

COLORS = "coolwarm"
SCALE = Normalize(-6.0, 6.0)  # mm


def draw(data: Path, frames: list[Tracked], path: Path) -> None:
    """Draws the first, last and two frames in between."""
    figure = Figure(figsize=(14, 4.2), layout="constrained")
    shown = [frames[i] for i in np.linspace(0, len(frames) - 1, 4).astype(int)]
    for axes, frame in zip(figure.subplots(1, 4), shown):
        edges = cv2.Canny(np.asarray(read(data / f"color_{frame.name}.png"), np.uint8), 60, 140)
        axes.imshow(255 - edges // 3, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        mask = mask_of(data, frame.name)
        error, inside = vertex_errors(frame.vertices, distance_of(data, frame.name), mask, CAMERA)
        axes.contour(mask, [0.5], colors="black", linewidths=0.8)
        u, v = CAMERA.project(frame.vertices).T
        axes.triplot(u, v, frame.faces, color="0.55", linewidth=0.35)
        known = np.isfinite(error)
        axes.scatter(u[known], v[known], c=error[known] * 1e3, s=9, cmap=COLORS, norm=SCALE, zorder=3)
        axes.set_title(
            f"frame {frame.name}: {frame.agreement.forward_mm:.1f} / {frame.agreement.backward_mm:.1f} mm, "
            f"{inside.mean():.0%} inside",
            fontsize=10,
        )
        axes.set_xlim(*WINDOW[:2])
        axes.set_ylim(*WINDOW[2:])
        axes.set_axis_off()
    figure.colorbar(
        ScalarMappable(SCALE, COLORS), ax=figure.axes, label="synthesised − measured distance [mm]", shrink=0.85
    )
    figure.savefig(path, dpi=90)

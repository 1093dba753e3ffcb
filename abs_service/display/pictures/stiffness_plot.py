"""A strip from its side: measured points, tracked shape, and the beam model's prediction."""

from pathlib import Path

import numpy as np

from abs_service.report import plots
from abs_service.tracking.bending_stiffness.hanging_strip import Profiles

#: What is shown around the strip [mm]; pixels at its edges that are of the background lie anywhere.
MARGIN_MM = 20.0


def draw(profiles: Profiles, title: str, path: Path) -> None:
    """Draws the side view, and the inclination along the strip, in the format of the file's suffix.

    Raises:
        ValueError: no such format.
        OSError: the file cannot be written.
    """
    figure = plots.figure(11, 4.6)
    figure.suptitle(title)
    side, angle = figure.subplots(1, 2)
    side.plot(*(profiles.measured.T * 1e3), ".", color="0.7", markersize=3, label="depth pixels")
    side.plot(*(profiles.tracked.T * 1e3), ".", color="tab:blue", markersize=4, label="tracked vertices")
    side.plot(*(profiles.predicted.T * 1e3), color="tab:orange", label="heavy elastica")
    side.plot(0, 0, "ks", markersize=7, label="gripper")
    side.set(xlabel="horizontal distance from the gripper [mm]", ylabel="drop [mm]", aspect="equal")
    strip = 1e3 * np.concatenate([profiles.tracked, profiles.predicted, [[0.0, 0.0]]])
    (left, top), (right, bottom) = strip.min(axis=0) - MARGIN_MM, strip.max(axis=0) + MARGIN_MM
    side.set(xlim=(left, right), ylim=(bottom, top))
    side.legend()
    degrees = np.rad2deg(profiles.inclination)
    angle.errorbar(
        profiles.along * 1e3, degrees, 2 * np.rad2deg(profiles.deviation), fmt="o", capsize=3, label="tracked ± 2σ"
    )
    angle.plot(profiles.predicted_along * 1e3, np.rad2deg(profiles.predicted_inclination), label="heavy elastica")
    angle.set(xlabel="along the strip [mm]", ylabel="inclination below the horizontal [°]")
    angle.legend()
    figure.savefig(path, dpi=120)

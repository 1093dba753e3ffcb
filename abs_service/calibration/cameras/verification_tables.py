"""Evidence of a verification: tables, pictures and machine-readable values."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from abs_service.calibration.files.rig_file import RigCalibration
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report import figures
from abs_service.report.content import Column, Section, Table, drawing
from calib.calibration_check.changes import PairChange
from calib.calibration_check.hypotheses import CornerFit, DistanceBias, MotionHypothesis


def sensors(
    fits: Mapping[str, CornerFit], expected_px: Mapping[str, float], biases: Mapping[str, DistanceBias]
) -> Section:
    """Table of each sensor alone."""
    columns = (
        Column("sensor"), Column("views"), Column("corners miss by", "px", ".3f"), Column("usual", "px", ".3f"),
        Column("distances exceed by", "mm", ".2f"), Column("±", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (name, fit.views, fit.rms, expected_px[name], *_bias_mm(biases.get(name))) for name, fit in fits.items()
    )
    text = "The pose of the board is estimated in every image, with the stored camera."
    return Section("Each sensor alone", (text, Table("Reprojection errors of the stored cameras", columns, rows)))


def pairs(changes: Sequence[PairChange], explanations: Mapping[str, MotionHypothesis]) -> list[Section]:
    """Tables of relative motion and of hypotheses; empty without pairs."""
    if not changes:
        return []
    columns = (
        Column("pair"), Column("shots"), Column("moved", "mm", ".2f"), Column("turned", "°", ".3f"),
        Column("shift", "px", ".2f"), Column("by chance", "px", ".2f"), Column("χ² of 6", "", ".1f"),
    )  # fmt: skip
    rows = tuple(
        (
            f"{one.first}, {one.second}", one.shots, float(np.linalg.norm(one.move) * 1e3),
            float(np.rad2deg(np.linalg.norm(one.turn))), one.shift_px, one.sigma_px, one.squared,
        )
        for one in changes
    )  # fmt: skip
    text = "Motion of the second sensor of a pair relative to the first, and the uncertainty of both calibrations."
    found = [Section("Pairs of sensors", (text, Table("Changes since the calibration", columns, rows)))]
    if explanations:
        freed = Table(
            "Share of the contradictions that go away",
            (Column("sensor set free"), Column("explains", "%", ".1f"), Column("left", "σ²", ".4g")),
            tuple((name, 100 * one.share, one.left) for name, one in explanations.items()),
        )
        found.append(Section("Sensor that moved", ("One sensor at a time may move, all others stay as stored.", freed)))
    return found


def fields(known: RigCalibration, fits: Mapping[str, CornerFit]) -> Section:
    """Residuals over the images."""
    pictures = []
    for name, fit in fits.items():
        camera = known.sensors[name].camera
        figure = figures.residual_field(fit.pixels, -fit.residuals, camera.width, camera.height)
        caption = f"{name}: measured less predicted corners. Arrows that agree with their neighbours are no noise."
        alt = f"{len(fit.pixels)} corners of {name} miss by {fit.rms:.2f} pixels, root mean square."
        pictures.append(drawing(figure, caption, alt))
    return Section("Residuals", tuple(pictures))


def refusals(seen: BoardObservations) -> list[Section]:
    """Reasons for rejected images; empty without any."""
    if not seen.rejected:
        return []
    counts = Counter((sensor, str(error)) for (_, sensor), error in seen.rejected.items())
    rows = tuple((sensor, count, why) for (sensor, why), count in counts.most_common(20))
    table = Table("The most frequent reasons", (Column("sensor"), Column("images"), Column("why")), rows)
    return [Section("Images that were not used", (table,))]


def values(
    fits: Mapping[str, CornerFit],
    biases: Mapping[str, DistanceBias],
    changes: Sequence[PairChange],
    explanations: Mapping[str, MotionHypothesis],
) -> dict[str, Any]:
    """Machine-readable values."""
    return {
        "sensors": {name: {"views": fit.views, "corners_px": fit.rms} for name, fit in fits.items()},
        "distance_bias_m": {name: bias.mean for name, bias in biases.items()},
        "pairs": [
            {
                "first": one.first, "second": one.second, "shots": one.shots, "move_m": one.move, "turn_rad": one.turn,
                "shift_px": one.shift_px, "sigma_px": one.sigma_px, "chi_squared": one.squared,
                "significant": one.is_significant,
            }
            for one in changes
        ],
        "explained_by": {name: one.share for name, one in explanations.items()},
    }  # fmt: skip


def _bias_mm(bias: DistanceBias | None) -> tuple[float | None, float | None]:
    return (None, None) if bias is None else (1e3 * bias.mean, 1e3 * bias.sigma)

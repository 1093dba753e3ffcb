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
from calib.calibration_check.comparison import Comparison
from calib.calibration_check.optics import OpticsChange
from calib.calibration_check.sensor_fits import CornerFit, DistanceBias
from calib.solve.rounding import rounded


def sensors(
    fits: Mapping[str, CornerFit], expected_px: Mapping[str, float], biases: Mapping[str, DistanceBias]
) -> Section:
    """Table of each sensor alone."""
    columns = (
        Column("sensor"), Column("views"), Column("corners miss by", "px", ".3f"), Column("typical", "px", ".3f"),
        Column("distances exceed by", "mm", ".2f"), Column("±", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (name, fit.views, fit.rms, expected_px[name], *_bias_mm(biases.get(name))) for name, fit in fits.items()
    )
    text = "The pose of the board is estimated in every image, with the stored camera."
    return Section("Each sensor alone", (text, Table("Reprojection errors of the stored cameras", columns, rows)))


def pairs(changes: Sequence[PairChange], comparison: Comparison) -> list[Section]:
    """Tables of relative motion and of explanations; empty without pairs."""
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
    table = Table("Changes since the calibration, if they are motion", columns, rows)
    return [Section("Pairs of sensors", (text, table)), _explanations(comparison)]


def _explanations(comparison: Comparison) -> Section:
    best = comparison.explanations[0]
    explained = Table(
        "Explanations, the best first",
        (
            Column("what"), Column("sensor"), Column("parameters"), Column("predicts worse by", "nats", ".1f"),
            Column("out"),
        ),
        tuple(
            (
                one.hypothesis.kind.value, ", ".join(one.hypothesis.sensors), len(one.values),
                float(best.scores.sum() + best.stored - one.scores.sum() - one.stored),
                "yes" if best.beats(one) else "no",
            )
            for one in comparison.explanations
        ),
    )  # fmt: skip
    how = (
        "Each shot is predicted from all others; an explanation that predicts worse by more than 3 nats and by two "
        "standard errors over the shots is out. Of the others the one with the fewest parameters is named. From shot "
        f"to shot, corners scatter by {rounded(comparison.corners_m * 1e3)} mm and distances by "
        f"{rounded(comparison.distances_m * 1e3)} mm beyond their noise."
    )
    return Section("What has changed", (how, explained))


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
    optics: Mapping[str, OpticsChange],
    biases: Mapping[str, DistanceBias],
    changes: Sequence[PairChange],
    comparison: Comparison,
) -> dict[str, Any]:
    """Machine-readable values."""
    return {
        "sensors": {name: {"views": fit.views, "corners_px": fit.rms} for name, fit in fits.items()},
        "optics": {
            name: {
                "focal": one.values[0], "center_px": one.values[1:], "sigmas": one.sigmas, "shift_px": one.shift_px,
                "chi_squared": one.squared, "significant": one.is_significant,
            }
            for name, one in optics.items()
        },
        "distance_bias_m": {name: bias.mean for name, bias in biases.items()},
        "pairs": [
            {
                "first": one.first, "second": one.second, "shots": one.shots, "move_m": one.move, "turn_rad": one.turn,
                "shift_px": one.shift_px, "sigma_px": one.sigma_px, "chi_squared": one.squared,
                "significant": one.is_significant,
            }
            for one in changes
        ],
        "explanations": [
            {
                "kind": one.hypothesis.kind.value, "sensors": list(one.hypothesis.sensors), "values": one.values,
                "sigmas": one.sigmas, "score": float(one.scores.sum() + one.stored),
                "possible": not comparison.explanations[0].beats(one),
            }
            for one in comparison.explanations
        ],
        "scatter_m": {"corners": comparison.corners_m, "distances": comparison.distances_m},
    }  # fmt: skip


def _bias_mm(bias: DistanceBias | None) -> tuple[float | None, float | None]:
    return (None, None) if bias is None else (1e3 * bias.mean, 1e3 * bias.sigma)

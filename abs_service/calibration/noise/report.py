"""Report of a noise calibration: verdicts, model comparison, error components, and plots."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from abs_service.calibration.noise import plots, verdicts
from abs_service.calibration.noise.measurement import NoiseCalibration
from abs_service.calibration.noise.sigma_consistency import SigmaConsistency
from abs_service.report import figures
from abs_service.report.content import Column, Level, Picture, Report, Section, Table, Verdict, drawing, photo
from abs_service.report.provenance import Provenance
from calib.noise.per_pixel import PerPixel
from calib.sequences.reference import Kind

#: Maximum number of sequences with a picture of static pixels.
_SHOWN = 3

_COLORS = {"static": (60, 160, 60), "target": (60, 90, 220), "left out": (160, 160, 160)}


def report(
    sensor: str,
    found: NoiseCalibration,
    consistencies: tuple[SigmaConsistency, ...],
    provenance: Provenance,
    repeated: Sequence[str] = (),
) -> Report:
    """Report of one sensor."""
    sections = [
        Section("Models", (_models(found),)),
        Section("Error components", (_WHAT, _parts(found))),
        *_boards(found),
        *_missing(found),
        Section("Distance and amplitude", (_over(found),)),
        Section("Pixels", tuple(_maps(found))),
        Section("Residuals", (_residuals(found),)),
        Section("Static pixels", tuple(_still(found))),
    ]
    if consistencies:
        sections.append(Section("The sensor's own deviation", (_sigma_table(consistencies),)))
    title = f"Noise of sensor {sensor}" if sensor else "Noise"
    joined = tuple(Verdict(Level.GOOD, f"{text}.") for text in repeated)
    return Report(title, provenance, (*verdicts.verdicts(found), *joined), tuple(sections), values(found))


_WHAT = (
    "Temporal is what changes from frame to frame. Fixed is what each pixel's mean differs by from what all pixels "
    "share. Offset is the mean difference from the real distance. A dash says that the sequence does not tell."
)


def values(found: NoiseCalibration) -> dict[str, object]:
    """Machine-readable values."""
    return {
        "model": found.chosen.candidate.name,
        "reference": str(found.kind),
        "reference_deviation_m": max((board.uncertainty for board in found.boards), default=None),
        "distances_m": list(found.distances),
        "amplitudes": list(found.amplitudes),
        "log_likelihood": found.chosen.score,
        "within_one": found.chosen.quality.within_one,
        "within_95": found.chosen.quality.within_95,
        "variance": found.chosen.quality.variance,
        "outlier_share": found.chosen.quality.outlier_share,
        "fixed_pattern_m": _pattern_deviation(found),
        "no_return": asdict(found.missing.law) if found.missing.targets else None,
        "step_digit_m": found.steps.digit,
        "step_growth_per_m": found.steps.growth,
    }


def _boards(found: NoiseCalibration) -> tuple[Section, ...]:
    """Board poses, if they are the reference."""
    if found.kind is not Kind.BOARD:
        return ()
    columns = (
        Column("sequence"), Column("seen by"), Column("points"), Column("miss, rms", "px", ".3f"),
        Column("distance", "m", ".4f"), Column("known to", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (static.name, board.seen_by, board.corners, board.rms_px, float(np.nanmean(one.distance)),
         board.uncertainty * 1e3)
        for static, one, board in zip(found.statics, found.references, found.boards)
    )  # fmt: skip
    return (Section("Boards", (Table("Board poses from the mean images of the sequences", columns, rows),)),)


def _missing(found: NoiseCalibration) -> tuple[Section, ...]:
    """Missing returns of every target, measured and by the law."""
    if not found.missing.targets:
        return ()
    columns = (
        Column("sequence"), Column("pixels"), Column("distance", "m", ".3f"), Column("angle", "°", ".0f"),
        Column("missing", "", ".2%"), Column("by the law", "", ".2%"),
    )  # fmt: skip
    rows = tuple(
        (one.name, len(one.share), float(np.mean(one.distance)), float(np.degrees(np.arccos(one.cosine)).mean()),
         float(np.mean(one.share)), float(np.mean(found.missing.law.probability(one.distance, one.cosine))))
        for one in found.missing.targets
    )  # fmt: skip
    return (Section("Missing returns", (Table("Share of the targets' returns that are missing", columns, rows),)),)


def _models(found: NoiseCalibration) -> Table:
    columns = (
        Column("model"), Column("coefficients of", "", ""), Column("number"),
        Column("log-likelihood held out", "", ".3f"),
        Column("behind the best", "", ".3f"), Column("±", "", ".3f"), Column("within σ", "", ".3f"),
        Column("within 1.96 σ", "", ".3f"), Column("variance", "", ".2f"), Column("outliers", "", ".3f"),
        Column("remark"),
    )  # fmt: skip
    best = max((trial for trial in found.trials if trial.scores), key=lambda trial: trial.score)
    rows = []
    for trial in found.trials:
        one, quality = trial.candidate, trial.quality
        behind = trial.behind(best) if trial.scores else (np.nan, np.nan)
        remark = trial.failure or "chosen" * (one.name == found.chosen.candidate.name)
        rows.append(
            (one.name, str(one.level), one.coefficients, trial.score if trial.scores else None, *behind,
             quality.within_one, quality.within_95, quality.variance, quality.outlier_share, remark)
        )  # fmt: skip
    held = "whole sequences" if found.by_sequence else "a third of the frames"
    return Table(f"Compared models; {held} were held out in turn", columns, tuple(rows))


def _parts(found: NoiseCalibration) -> Table:
    columns = (
        Column("sequence"), Column("pixels"), Column("distance", "m", ".3f"), Column("amplitude", "", ".0f"),
        Column("temporal", "mm", ".2f"), Column("fixed", "mm", ".2f"), Column("offset", "mm", ".2f"),
        Column("step", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (name, row.pixels, row.distance, row.amplitude, row.temporal * 1e3, row.fixed * 1e3, row.offset * 1e3,
         row.step * 1e3)
        for name, row in found.rows
    )  # fmt: skip
    return Table("Temporal, fixed and systematic part of the error", columns, rows)


def _over(found: NoiseCalibration) -> Picture:
    caption = "The model's σ and μ of the middle pixel, as in Fig. 8 of the paper; dots are what was measured."
    return drawing(plots.over_distance_and_amplitude(found), caption, "σ and μ over distance and amplitude")


def _maps(found: NoiseCalibration) -> list[str | Picture]:
    if found.kind is Kind.MEAN:
        return ["Without a flat target, constant errors of a pixel cannot be separated from the scene."]
    shown: list[str | Picture] = []
    pattern, deviation = found.pattern
    size = f"deviation {_pattern_deviation(found) * 1e3:.2g} mm, known to {np.nanmedian(deviation) * 1e3:.2g} mm."
    figure = figures.difference_map(pattern * 1e3, "pixel's own offset [mm]")
    shown.append(drawing(figure, f"Fixed-pattern noise over all sequences: {size}", "map of the fixed pattern"))
    if isinstance(found.model, PerPixel):
        figure = figures.image_map(found.model.factor, "pixel's own factor on σ")
        shown.append(drawing(figure, "Factors on σ relative to the image's model.", "map of factors on σ"))
    return shown


def _pattern_deviation(found: NoiseCalibration) -> float:
    """Deviation of the fixed pattern without the uncertainty of its map [m]; NaN if undetermined."""
    if found.kind is Kind.MEAN:
        return float("nan")
    pattern, deviation = (part[np.isfinite(found.pattern[0])] for part in found.pattern)
    middle = pattern - np.median(pattern)
    return float(np.sqrt(max(float(np.mean(middle**2) - np.mean(deviation**2)), 0.0)))


def _residuals(found: NoiseCalibration) -> Picture:
    return drawing(plots.histogram(found), "Held-out residuals over their deviations.", "histogram of residuals")


def _still(found: NoiseCalibration) -> list[str | Picture]:
    every = max(1, len(found.statics) // _SHOWN)
    pictures: list[str | Picture] = [
        "Green: static. Blue: static and on the target. Grey: moving, at a rim or without returns."
    ]
    for static, one in list(zip(found.statics, found.references))[::every][:_SHOWN]:
        image = np.empty((*static.mean.shape, 3), np.uint8)
        image[:] = _COLORS["left out"]
        image[static.still] = _COLORS["static"]
        if found.kind is not Kind.MEAN:
            image[np.isfinite(one.distance)] = _COLORS["target"]
        caption = f"{static.name}: {static.moving:.1%} of the pixels moved."
        pictures.append(photo(image, caption, "map of what was static"))
    return pictures


def _sigma_table(consistencies: tuple[SigmaConsistency, ...]) -> Table:
    columns = (
        Column("sequence"), Column("pixels"), Column("within σ", "", ".3f"), Column("within 1.96 σ", "", ".3f"),
        Column("deviation over reported σ", "", ".2f"),
    )  # fmt: skip
    rows = tuple((c.name, c.pixels, c.within_one, c.within_95, c.ratio) for c in consistencies)
    return Table("Residuals from local planes over the σ that the sensor reports", columns, rows)

"""Verdicts of a noise calibration in plain words: model to use, its reliability, and what is undetermined."""

import math

import numpy as np

from abs_service.calibration.noise import recordings
from abs_service.calibration.noise.measurement import NoiseCalibration
from abs_service.report.content import Level, Verdict
from calib.sequences.candidates import Level as Places
from calib.sequences.reference import Kind
from calib.sequences.selection import NOTHING, Trial, extremes, typical_sigma
from calib.solve.rounding import rounded

#: Tolerances of coverage and variance of held-out residuals about 68.3 %, 95 % and 1.
_COVERAGE, _VARIANCE = 0.03, (0.8, 1.25)

#: Ratio of largest to smallest distance below which a model covers a single distance; likewise for amplitudes.
_SPREAD = 1.3

#: Largest uncertainty of true distances at which an offset is meaningful [m].
_WELL_KNOWN = 2e-3

#: Factor by which the domain is extended to check extrapolation.
_OUTSIDE = 10.0

#: Largest ratio, either way, of the model's σ to what was measured.
_MISS = 2.0


def verdicts(found: NoiseCalibration) -> tuple[Verdict, ...]:
    """All verdicts, the most important first."""
    return (
        _use(found),
        _agreement(found),
        *_measured(found),
        *recordings.distances(found),
        *_boards(found),
        *_undetermined(found),
        *_missing(found),
        *_places(found),
        _outside(found),
        *_steps(found),
        *recordings.motion(found),
    )


def _use(found: NoiseCalibration) -> Verdict:
    near, far = found.distances
    amplitudes = f" and amplitudes {found.amplitudes[0]:.0f} to {found.amplitudes[1]:.0f}"
    domain = f"{near:.2f} to {far:.2f} m" + (amplitudes if math.isfinite(found.amplitudes[0]) else "")
    low, high, _ = extremes(found.model, found.distances, _amplitudes(found))
    if not 0 < low <= high < math.inf:  # NaN fails, too
        return Verdict(
            Level.BAD, f"{found.chosen.candidate.name} gives no σ at some of {domain}: {low:g} to {high:g} m."
        )
    return Verdict(
        Level.GOOD,
        f"Use {found.chosen.candidate.name}: σ is {rounded(low * 1e3)} to {rounded(high * 1e3)} mm for {domain}. "
        f"{len(found.trials)} models were compared by the likelihood of what they were not fitted to.",
    )


def _agreement(found: NoiseCalibration) -> Verdict:
    quality = found.chosen.quality
    text = (
        f"{quality.within_one:.1%} of what was held out lies within σ (68.3 % if the model is right), "
        f"{quality.within_95:.1%} within 1.96 σ (95 %); variance of the residuals {quality.variance:.2f}."
    )
    near = abs(quality.within_one - 0.683) < _COVERAGE and abs(quality.within_95 - 0.95) < _COVERAGE
    if near and _VARIANCE[0] < quality.variance < _VARIANCE[1]:
        return Verdict(Level.GOOD, text)
    if not all(map(math.isfinite, (quality.within_one, quality.within_95, quality.variance))):
        return Verdict(Level.BAD, f"What was held out does not tell whether the model is right: {text}")
    return Verdict(
        Level.DOUBTFUL, text, "Measure at more distances and on more materials, and check that targets are flat."
    )


def _measured(found: NoiseCalibration) -> list[Verdict]:
    """Comparison of σ with the scatter of every sequence or range of distances, the dots of the report's plot."""
    said = []
    for name, row in found.rows:
        sigma = typical_sigma(found.model, row.distance, row.amplitude)
        steps = row.step / math.sqrt(12)
        measured = max(float(np.hypot(row.temporal, np.nan_to_num(row.fixed))), steps)
        # What pixels differ by for good is no scatter about a mean offset of each pixel.
        minimum = max(row.temporal, steps) if found.chosen.candidate.level == "pixel" else measured
        if not minimum / _MISS < sigma < measured * _MISS:
            there = f"at {row.distance:.2f} m, where {rounded(measured * 1e3)} mm were measured."
            text = f"σ is {rounded(sigma * 1e3)} mm {there}"
            said.append(Verdict(Level.BAD, text, "Do not use the model there: look at its plot.", name))
    return said


def _boards(found: NoiseCalibration) -> list[Verdict]:
    """Uncertainty of the true distances from board poses."""
    if found.kind is not Kind.BOARD:
        return []
    worst = max(board.uncertainty for board in found.boards)
    seers = sorted({board.seen_by for board in found.boards})
    near, far = found.distances
    share = f"{near:.1f} to {far:.1f} mm" if f"{near:.1f}" != f"{far:.1f}" else f"{far:.1f} mm"
    text = (
        f"The reference is known to {rounded(worst * 1e3)} mm: the real distances are those of the board, whose pose "
        f"its corners tell in the images of {' and '.join(seers)}. The offset cannot be known better, and "
        f"errors of the cameras, of their poses in the rig and of the squares' size come on top: 0.1 % of focal length "
        f"or size is {share}."
    )
    if worst < _WELL_KNOWN:
        return [Verdict(Level.GOOD, text)]
    return [Verdict(Level.DOUBTFUL, text, "Take a larger board, tilt it by 20° or so, or come closer.")]


def _undetermined(found: NoiseCalibration) -> list[Verdict]:
    """Quantities that the sequences do not determine."""
    said = []
    if found.kind is Kind.MEAN:
        said.append(
            Verdict(
                Level.DOUBTFUL,
                "Only the temporal part of the noise is determined: no distance was given and no flat target fills the "
                "image. The mean offset and the fixed pattern are unknown, and taken as zero; how often returns are "
                "missing is not determined either.",
                "Record a flat target at known distances, and give them with --distance-m, or a board, with --target.",
            )
        )
    if found.kind is Kind.PLANE:
        said.append(
            Verdict(
                Level.DOUBTFUL,
                "The mean offset is not determined, and taken as zero: no distance was given, so planes were fitted "
                "where the sensor sees them. σ contains what pixels differ from these planes by.",
                "Measure the target's distance along the optical axis, and give it with --distance-m, or record a "
                "calibration board, and describe it with --target.",
            )
        )
    near, far = found.distances
    if far < _SPREAD * near:
        text = f"How noise changes with distance is not determined: all distances lie in {near:.2f} to {far:.2f} m."
        said.append(Verdict(Level.DOUBTFUL, text, "Record at five distances over the range that you use."))
    if found.amplitudes[1] < 2 * found.amplitudes[0]:
        text = "How the noise changes with the amplitude is not determined: all amplitudes are of one size."
        said.append(Verdict(Level.DOUBTFUL, text, "Record three materials: white, grey and dark."))
    if not found.by_sequence:
        number = len(found.statics)
        text = (
            f"{number} sequence{'s are' if number > 1 else ' is'} too few to hold out a whole one: models were "
            "compared on other frames of the same sequences, which share their targets' flaws."
        )
        said.append(Verdict(Level.DOUBTFUL, text, "Record at least three sequences."))
    return said


def _missing(found: NoiseCalibration) -> list[Verdict]:
    """Frequency of missing returns, if targets were recorded."""
    if not found.missing.targets:
        return []
    share, distance, cosine = (
        np.concatenate([getattr(one, name) for one in found.missing.targets])
        for name in ("share", "distance", "cosine")
    )
    text = (
        f"{np.mean(share):.2%} of the targets' returns are missing, at {distance.min():.2f} to {distance.max():.2f} m, "
        f"seen at up to {np.degrees(np.arccos(cosine.min())):.0f}° from the front. The probability of no return is "
        f"{found.missing.law.share:.2%} from the front at 1 m; no_return says how it grows."
    )
    return [Verdict(Level.GOOD, text)]


def _places(found: NoiseCalibration) -> list[Verdict]:
    """Gain of maps of regions and pixels, which need a target."""
    parts = []
    for trial in found.trials:
        if trial.candidate.level is Places.IMAGE or not trial.scores:
            continue
        name = f"maps of {trial.candidate.level}s"
        parts.append(f"{name} {_gain(found.law, trial)}")
    if found.kind is Kind.MEAN:
        return []
    return [Verdict(Level.GOOD, f"Beside one law for the whole image, {' and '.join(parts)}.") if parts else _none()]


def _gain(law: Trial, trial: Trial) -> str:
    gain, deviation = law.behind(trial)
    if gain <= NOTHING:
        return f"say no more than noise here (log-likelihood {gain:+.3f} ± {deviation:.3f} per measurement)"
    return f"gain {gain:.3f} ± {deviation:.3f} log-likelihood per measurement"


def _none() -> Verdict:
    return Verdict(Level.DOUBTFUL, "Maps of regions and pixels could not be fitted.")


def _outside(found: NoiseCalibration) -> Verdict:
    """Check of the model's extrapolation."""
    near, far = found.distances
    _, high, _ = extremes(found.model, found.distances, _amplitudes(found))
    beyond = extremes(found.model, (near / _OUTSIDE, far * _OUTSIDE), (0.0, 65535.0))
    text = (
        f"Outside what was measured σ stays between {rounded(beyond[0] * 1e3)} and {rounded(beyond[1] * 1e3)} mm, and "
        f"μ within {rounded(beyond[2] * 1e3)} mm, up to {far * _OUTSIDE:.0f} m and at any amplitude."
    )
    sound = all(map(math.isfinite, beyond)) and beyond[0] > 0
    grows = beyond[1] > 1.001 * high
    known = " It grows with the distance there, as the sensor's steps do." if grows else ""
    return Verdict(Level.GOOD if sound else Level.BAD, text + known)


def _amplitudes(found: NoiseCalibration) -> tuple[float, float]:
    return found.amplitudes if math.isfinite(found.amplitudes[0]) else (0.0, 1.0)


def _steps(found: NoiseCalibration) -> list[Verdict]:
    far = found.distances[1]
    step = float(found.steps.at(np.array(far)))
    if found.steps.growth > 0:
        text = (
            f"Distances come in steps of {found.steps.growth:.3g} x² (a disparity), {rounded(step * 1e3)} mm at "
            f"{far:.2f} m; σ contains their share, step²/12."
        )
        return [Verdict(Level.GOOD, text)]
    text = f"Distances come in steps of {rounded(step * 1e3)} mm at {far:.2f} m; σ contains their share."
    return [Verdict(Level.GOOD, text)] if step > 0 else []

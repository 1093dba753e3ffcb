"""Verification of a stored calibration against new views of a board, as a report in plain words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from abs_service.calibration.cameras import causes, fit_verdict, new_views
from abs_service.calibration.cameras import verification_tables as tables
from abs_service.calibration.cameras.causes import UNNOTICED_M, WRONG_M, DistanceRange
from abs_service.calibration.cameras.fit_verdict import SPOILT_PX, UNNOTICED_PX
from abs_service.calibration.files.rig_file import RigCalibration
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.content import Level, Report, Verdict
from abs_service.report.provenance import Provenance
from calib.calibration_check import mistakes
from calib.calibration_check.board_size import gross_size
from calib.calibration_check.changes import PairChange, contradicting, pair_changes
from calib.calibration_check.comparison import NOT_COMPARED, Comparison, compare
from calib.calibration_check.hypotheses import TERMS, Kind
from calib.calibration_check.misprint import misprint
from calib.calibration_check.optics import OpticsChange, optics_change
from calib.calibration_check.sensor_fits import CornerFit, DistanceBias, corner_fit, distance_bias, distance_error
from calib.calibration_check.stored_calibration import Stored, Views, usable
from calib.solve.validation.inconsistent_shots.foreign_distances import DistanceError

#: Expected reprojection error if the calibration does not contain its own [px].
BASELINE_PX = 0.5

#: Insignificant shift that is too large for a verdict: too few views [px].
BLIND_PX = 2.0

#: Scatter of images from shot to shot that is more than lenses leave, and that is unacceptable [px].
SCATTERS_PX, SPOILS_PX = 1.0, 3.0


@dataclass(frozen=True)
class Verification:
    """Results of a verification.

    Attributes:
        fits: residuals of sensors with corners, by sensor.
        optics: changes of their focal lengths and principal points, where those are known.
        focal_px: their focal lengths.
        expected_px: their reprojection errors at calibration.
        biases: distance bias of sensors with corners and distances.
        errors: mistakes in the distances of sensors, by sensor.
        changes: relative motion of all pairs.
        comparison: explanations of the shots; `NOT_COMPARED` without two sensors that saw the board together.
        reaches: distances of the boards that sensors measured.
        likelier: another sensor whose camera fits the corners better, by sensor; "" if there is none.
        unused: verdicts on sensors without views, and on views that were left out.
        sensors: number of sensors.
    """

    fits: Mapping[str, CornerFit]
    optics: Mapping[str, OpticsChange]
    focal_px: Mapping[str, float]
    expected_px: Mapping[str, float]
    biases: Mapping[str, DistanceBias]
    errors: Mapping[str, DistanceError]
    changes: tuple[PairChange, ...]
    comparison: Comparison
    reaches: Mapping[str, DistanceRange]
    likelier: Mapping[str, str]
    unused: tuple[Verdict, ...]
    sensors: int


def verify(known: RigCalibration, seen: BoardObservations, provenance: Provenance) -> Report:
    """Report on a calibration.

    Raises:
        CalibrationCheckError: no usable view.
        NotSolvedError, UndeterminedError: the views do not determine the board poses.
    """
    title, stored = f"Verification of {known.name}", new_views.stored_in(known)
    used = usable(stored, new_views.of_known_sensors(seen, stored))
    wrong = causes.of_material(gross_size(stored, used), mistakes.find(stored, used.corners))
    if wrong:
        said = (*wrong, *new_views.verdicts(known, seen, used))
        return Report(title, provenance, said, tuple(tables.refusals(seen)), {})
    found = _found(known, stored, seen, used)
    sections = [
        tables.sensors(found.fits, found.expected_px, found.biases),
        *tables.pairs(found.changes, found.comparison),
    ]
    sections += [tables.fields(known, found.fits), *tables.refusals(seen)]
    values = tables.values(found.fits, found.optics, found.biases, found.changes, found.comparison)
    said = verdicts(found)
    # A good board and good cameras need no solve of their own.
    if said[0].level > Level.GOOD and (wrong_print := misprint(stored, new_views.thinned(used), SPOILT_PX)):
        said = [causes.of_misprint(wrong_print), *new_views.verdicts(known, seen, used)]
    return Report(title, provenance, tuple(said), tuple(sections), values)


def verdicts(found: Verification) -> list[Verdict]:
    """Verdicts, the worst first."""
    motion = max((_level(change) for change in found.changes if change.is_significant), default=Level.GOOD)
    fits = [
        fit_verdict.of_fit(name, fit, found.expected_px[name], found.optics.get(name), found.likelier[name])
        for name, fit in found.fits.items()
    ]
    scatter = _of_scatter(found, max(one.level for one in fits))
    # Shots that do not agree with each other say nothing of a change that lasts.
    disagree = any(one.level == Level.BAD for one in scatter)
    lasting = [] if disagree or found.errors else causes.verdicts(found.comparison, motion, found.reaches)
    is_board = bool(lasting) and found.comparison.chosen.hypothesis.kind == Kind.BOARD
    named = {*found.biases} if is_board else {one.about for one in lasting} | {*found.errors}
    said = [causes.of_distance_error(error) for error in found.errors.values()]
    said += [*lasting, *(scatter or causes.of_contradictions(contradicting(found.changes))), *fits]
    said += [_of_bias(name, bias) for name, bias in found.biases.items() if name not in named]
    changes = [change for change in found.changes if not (disagree or _is_explained(change, found))]
    said += [_of_pair(change, found.comparison) for change in changes]
    said += found.unused
    if found.sensors > 1 and not found.changes:
        text = "No two sensors saw the board together often enough to be compared; three shots are needed, better ten."
        said.append(Verdict(Level.DOUBTFUL, text, "Show the board to several sensors at once."))
    return sorted(said, key=lambda verdict: -verdict.level)


def _found(known: RigCalibration, stored: Stored, seen: BoardObservations, used: Views) -> Verification:
    sensors = stored.sensors
    views = new_views.thinned(used)
    observers = dict.fromkeys(view.sensor for view in views.corners)
    biases = {name: distance_bias(stored, views, name) for name in observers}
    reaches = causes.reaches(views)
    errors = {name: distance_error(stored, views, name, SPOILT_PX) for name in reaches}
    changes = tuple(pair_changes(stored, views))
    baseline = {name: known.sensors[name].residuals.corners_px for name in observers}
    optics = {name: change for name in observers if (change := optics_change(stored, views, name)) is not None}
    unseen = {name: change.unseen for name, change in optics.items() if not change.is_significant}
    return Verification(
        {name: corner_fit(stored, views, name) for name in observers},
        optics,
        {name: sensors[name].camera.fx for name in observers},
        {name: BASELINE_PX if px is None else px for name, px in baseline.items()},
        {name: bias for name, bias in biases.items() if bias is not None},
        {name: error for name, error in errors.items() if error is not None},
        changes,
        _compared(stored, views, changes).without_focal(unseen),
        reaches,
        {name: mistakes.likelier(stored, views, name) for name in observers},
        tuple(new_views.verdicts(known, seen, used)),
        len(sensors),
    )


def _compared(stored: Stored, views: Views, changes: Sequence[PairChange]) -> Comparison:
    """Explanations of the sensors that saw the board together, from the first pair on."""
    together: set[str] = set()
    for _ in changes:
        for change in changes:
            if not together or together & {change.first, change.second}:
                together |= {change.first, change.second}
    wrong = {one.shot for one in contradicting(changes)}
    shots = [number for name in together for number in views.shots[name] if number not in wrong]
    return compare(stored, views.of(together, shots)) if together else NOT_COMPARED


def _of_bias(name: str, bias: DistanceBias) -> Verdict:
    said = f"distances exceed those that its corners say by {bias.mean * 1e3:+.1f} ± {bias.sigma * 1e3:.1f} mm."
    if abs(bias.mean) < max(UNNOTICED_M, 3 * bias.sigma):
        return Verdict(Level.GOOD, f"still measures as it was calibrated: {said}", about=name)
    level = Level.BAD if abs(bias.mean) > WRONG_M else Level.DOUBTFUL
    advice = "Let it warm up for half an hour and look again; if it stays, calibrate its depth terms."
    return Verdict(level, f"measures otherwise than it was calibrated: {said}", advice, name)


def _level(change: PairChange) -> Level:
    if not change.is_significant:
        return Level.DOUBTFUL if change.sigma_px > BLIND_PX else Level.GOOD
    if change.shift_px < UNNOTICED_PX:
        return Level.GOOD
    return Level.BAD if change.shift_px > SPOILT_PX else Level.DOUBTFUL


def _of_pair(change: PairChange, comparison: Comparison) -> Verdict:
    about, level = f"{change.first} and {change.second}", _level(change)
    said = (
        f"{_how_far(change)}, which shifts pictures by {change.shift_px:.2f} px; {change.sigma_px:.2f} px are chance."
    )
    if not change.is_significant and level == Level.DOUBTFUL:
        advice = "Show the board to both at once, nearer, tilted and in more places."
        return Verdict(level, f"could not be compared well enough: {said}", advice, about)
    if change.during:
        text = f"moved to each other during these shots, from about shot {change.during[0].shot} on: {said}"
        advice = "Fasten the sensors, and calibrate the rig again."
        return Verdict(Level.BAD if change.during[0].shift_px > SPOILT_PX else Level.DOUBTFUL, text, advice, about)
    if level == Level.GOOD:
        return Verdict(level, f"stand as they were calibrated: {said}", about=about)
    if comparison.chosen.hypothesis.kind == Kind.UNCHANGED:
        text = f"contradict each other, though no change of a sensor predicts the shots better than none: {said}"
        return Verdict(Level.DOUBTFUL, text, "Take more shots, each with the board held still.", about)
    return Verdict(level, f"no longer stand as they were calibrated: {said}", "Calibrate the rig again.", about)


def _is_explained(change: PairChange, found: Verification) -> bool:
    """True if a pair disagrees because the board has another size, or the distances or focal length of one changed."""
    chosen = found.comparison.chosen.hypothesis
    explains = chosen.kind in (*TERMS, Kind.FOCAL) and bool({*chosen.sensors} & {change.first, change.second})
    return change.is_significant and (explains or chosen.kind == Kind.BOARD)


def _of_scatter(found: Verification, worst_fit: Level) -> list[Verdict]:
    """Verdict on images that fit alone and, from shot to shot, not together; at most one."""
    observers = [name for name in found.fits if any(name in {one.first, one.second} for one in found.changes)]
    scatter_m = np.sqrt(2) * found.comparison.corners_m
    shift_px = max((found.focal_px[name] for name in observers), default=0.0) * scatter_m / found.comparison.distance_m
    if len(observers) < 2 or worst_fit > Level.GOOD or shift_px < SCATTERS_PX:
        return []
    text = (
        f"{', '.join(observers)}: each fits its own corners, but they see the board {scatter_m * 1e3:.1f} mm apart "
        f"({shift_px:.1f} px), elsewhere in each shot: the images of a shot were not taken at the same moment."
    )
    level = Level.BAD if shift_px > SPOILS_PX else Level.DOUBTFUL
    return [Verdict(level, text, "Hold the board still in every shot, or synchronise the sensors.")]


def _how_far(change: PairChange) -> str:
    return f"{np.linalg.norm(change.move) * 1e3:.1f} mm and {np.rad2deg(np.linalg.norm(change.turn)):.2f}°"

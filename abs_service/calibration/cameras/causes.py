"""Verdict on the changes since a calibration, in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from abs_service.report.content import Level, Verdict
from calib.calibration_check import mistakes
from calib.calibration_check.comparison import Comparison, Explanation
from calib.calibration_check.hypotheses import TERMS, Kind
from calib.calibration_check.mistakes import Mistake
from calib.calibration_check.stored_calibration import Views
from calib.solve.rounding import rounded
from calib.solve.validation.board_shape import ShapeError
from calib.solve.validation.inconsistent_shots.contradictions import Contradiction
from calib.solve.validation.inconsistent_shots.foreign_distances import DistanceError

#: Distance bias that is as good as any depth camera's, and that is unacceptable [m].
UNNOTICED_M, WRONG_M = 0.002, 0.01

_ADVICE = {
    Kind.MOVED: "Put it back and fix it, or calibrate the rig again.",
    Kind.ALIGNMENT: "Calibrate the device again, or use its depth image before alignment.",
    Kind.BOARD: "Measure the squares with a ruler, and correct the description of the board.",
    Kind.FOCAL: "Was it refocused, zoomed or set to another mode? If so, calibrate its intrinsics again.",
    Kind.SEVERAL: "Calibrate the rig again.",
}
_WARM = "Let it warm up for half an hour and look again; if it stays, calibrate its depth terms."

_OF_TWO = (mistakes.Kind.EXCHANGED, mistakes.Kind.REPEATED)
_MISTAKES = {
    mistakes.Kind.EXCHANGED: (
        "the images of {0} seem to be those of {1} and the other way round: with the names exchanged",
        "Exchange the names of the images, or those in the calibration.",
    ),
    mistakes.Kind.REPEATED: ("{0} and {1} have the same images", "Give each sensor its own images."),
    mistakes.Kind.MIRRORED: (
        "{0} seems to show the board as in a mirror: mirrored back,",
        "Switch off the mirroring of the camera or its driver.",
    ),
    mistakes.Kind.TURNED: (
        "the images of {0} seem to be turned by 180°: turned back,",
        "Switch off the turning of images in the camera or its driver.",
    ),
}


@dataclass(frozen=True)
class DistanceRange:
    """Distances of the boards that a sensor measured [m]."""

    near: float
    far: float


def reaches(views: Views) -> dict[str, DistanceRange]:
    """Distances of the boards by the sensors that measured them."""
    found: dict[str, list[float]] = {}
    for view in views.planes:
        found.setdefault(view.sensor, []).append(float(np.median(view.distances)))
    return {name: DistanceRange(min(distances), max(distances)) for name, distances in found.items()}


def verdicts(found: Comparison, motion: Level, reaches: Mapping[str, DistanceRange]) -> list[Verdict]:
    """Verdict on a change that all shots share; none if there is none, or none that matters.

    Args:
        found: explanations of the shots.
        motion: level of what the pairs of sensors show, if it is motion.
        reaches: of the sensors that measure distances.
    """
    chosen, rivals = found.chosen, found.rivals
    if chosen.hypothesis.kind == Kind.UNCHANGED:
        return []
    level = max(_level(each, motion, reaches) for each in (chosen, *rivals))
    if level == Level.GOOD:
        return []
    kind = chosen.hypothesis.kind
    if kind == Kind.SEVERAL:
        text = "No single change explains what no longer fits: more than one sensor has moved, or a camera has changed."
        return [Verdict(level, text, _ADVICE[kind])]
    if rivals and all(each.hypothesis.kind == Kind.MOVED for each in (chosen, *rivals)):
        names = ", ".join(sorted(_names(each) for each in (chosen, *rivals)))
        text = f"One of {names} has moved; these views cannot tell which, since each would explain them."
        return [Verdict(level, text, _advice((chosen, *rivals), reaches))]
    text = f"{_said(chosen)}."
    if rivals:
        others = "; ".join(f"{_names(rival)} {_said(rival)}".strip() for rival in rivals)
        text += f" These shots cannot tell that from this: {others}."
    text = text if _names(chosen) else text[0].upper() + text[1:]
    return [Verdict(level, text, _advice((chosen, *rivals), reaches), _names(chosen))]


def of_contradictions(found: Sequence[Contradiction]) -> list[Verdict]:
    """Verdict on shots that contradict the others; none without any."""
    if not found:
        return []
    text = f"{'; '.join(map(str, found))}. The others agree; these shots were left out of what follows."
    skipped = ",".join(str(one.shot) for one in found)
    return [Verdict(Level.DOUBTFUL, text, f"Look at the pictures, and leave out what is wrong: --skip {skipped}.")]


def of_material(size: float, found: Sequence[Mistake]) -> list[Verdict]:
    """Verdict on a board or images from which nothing can be said of the calibration; at most one.

    Args:
        size: factor by which the board is larger than described, if that is gross, otherwise 1.
        found: mistakes of which each would explain the images.
    """
    return [_of_size(size)] if size != 1 else [_of_mistakes(found)] if found else []


def of_misprint(found: ShapeError) -> Verdict:
    """Verdict on a board whose print is not as described."""
    text = f"{found.finding[0].upper()}{found.finding[1:]}. Nothing else can be said of the calibration."
    return Verdict(Level.BAD, text, f"{found.shape.value[0].upper()}{found.shape.value[1:]}.")


def of_distance_error(found: DistanceError) -> Verdict:
    """Verdict on distances of another geometry or unit, or on a depth image that is displaced, mirrored or turned."""
    return Verdict(Level.BAD, f"{found.finding}.", f"{found.remedy[0].upper()}{found.remedy[1:]}.", found.sensor)


def _of_mistakes(found: Sequence[Mistake]) -> Verdict:
    best = found[0]
    said = "; or ".join(_mistaken(one) for one in found)
    text = f"{said[0].upper()}{said[1:]}. As given, corners miss by {best.given_px:.3g} px."
    return Verdict(Level.BAD, f"{text} Nothing else can be said of the calibration.", _MISTAKES[best.kind][1])


def _of_size(size: float) -> Verdict:
    text = (
        f"The squares of the board are about {size:.3g} times as large as described (or those of the board that the "
        "rig was calibrated with were not as described). Nothing else can be said of the calibration."
    )
    return Verdict(Level.BAD, text, f"{_ADVICE[Kind.BOARD]} Its lengths are in millimetres if their keys end in _mm.")


def _mistaken(mistake: Mistake) -> str:
    names = mistake.sensors if mistake.kind in _OF_TWO else (" and ".join(mistake.sensors),)
    said = _MISTAKES[mistake.kind][0].format(*names)
    return said if np.isnan(mistake.undone_px) else f"{said} corners miss by {rounded(mistake.undone_px)} px"


def _level(explanation: Explanation, motion: Level, reaches: Mapping[str, DistanceRange]) -> Level:
    """Level of a change by its effect on images, or on distances in the middle of the boards."""
    kind = explanation.hypothesis.kind
    if kind == Kind.BOARD:
        middles = [(reach.near + reach.far) / 2 for reach in reaches.values()]
        return max(motion, _of_distance(max(middles, default=0.0) * (explanation.board_size - 1)))
    if kind not in TERMS:
        return motion
    terms = dict(zip(TERMS[kind], explanation.values.tolist(), strict=True))
    reach = reaches[explanation.hypothesis.sensors[0]]
    middle = (reach.near + reach.far) / 2
    return _of_distance(terms.get("depth_scale", 0.0) * middle + terms.get("depth_offset", 0.0))


def _of_distance(miss_m: float) -> Level:
    return Level.GOOD if abs(miss_m) < UNNOTICED_M else Level.BAD if abs(miss_m) > WRONG_M else Level.DOUBTFUL


def _names(explanation: Explanation) -> str:
    return " with ".join(explanation.hypothesis.sensors)


def _said(explanation: Explanation) -> str:
    """The change of the sensor, as a clause without its name."""
    kind, values = explanation.hypothesis.kind, explanation.values
    if kind == Kind.BOARD:
        size, sigma = explanation.board_size, explanation.board_size**2 * explanation.sigmas[0]
        return (
            f"the squares of the board are {size:.4f} ± {sigma:.4f} times as large as described (or those of the board "
            "that the rig was calibrated with were not as described)"
        )
    if kind in TERMS:
        pairs = zip(TERMS[kind], values.tolist(), explanation.sigmas.tolist(), strict=True)
        return f"measures distances wrongly, by {' and '.join(_term(*each) for each in pairs)}"
    if kind == Kind.FOCAL:
        return f"has another focal length, by {_percent(values[0], explanation.sigmas[0])}"
    verb = "is aligned wrongly" if kind == Kind.ALIGNMENT else "has moved"
    return f"{verb}, by {np.linalg.norm(values[3:]) * 1e3:.1f} mm and {np.rad2deg(np.linalg.norm(values[:3])):.2f}°"


def _term(name: str, value: float, sigma: float) -> str:
    return _percent(value, sigma) if name == "depth_scale" else f"{1e3 * value:+.1f} ± {1e3 * sigma:.1f} mm"


def _percent(value: float, sigma: float) -> str:
    return f"{100 * value:+.2f} ± {100 * sigma:.2f} %"


def _advice(every: Sequence[Explanation], reaches: Mapping[str, DistanceRange]) -> str:
    """Action that mends what explains the shots, or that tells explanations apart."""
    of_sensors = [each for each in every if each.hypothesis.kind != Kind.BOARD]
    if len(of_sensors) < len(every):
        otherwise = f" If they are as described: {_advice(of_sensors, reaches)}" if of_sensors else ""
        return f"{_ADVICE[Kind.BOARD]}{otherwise}"
    if len(every) == 1:
        return _ADVICE.get(every[0].hypothesis.kind, _WARM)
    if all(each.hypothesis.kind == Kind.MOVED for each in every):
        return "Calibrate the rig again. A third sensor that sees the board at the same time could tell."
    sensor = next((each.hypothesis.sensors[0] for each in every if each.hypothesis.kind in TERMS), "")
    if not sensor:
        return "To tell, show the board to all sensors much nearer and much further, and tilted every way."
    reach = reaches[sensor]
    board = f"the board much nearer than {reach.near:.2f} m and much further than {reach.far:.2f} m"
    if all(each.hypothesis.kind in TERMS for each in every):
        return f"To tell, show {sensor} {board}."
    return f"To tell, show {sensor} {board}, on all sides of its image and tilted every way."

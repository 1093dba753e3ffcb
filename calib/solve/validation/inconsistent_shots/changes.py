"""Changes of a sensor between shots: whether the shots before and after confirm them, and what is said of them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.parameters.lens_parameters import ASPECT
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.start.start import fit_camera
from calib.solve.validation.inconsistent_shots.steadiness import Change, rms
from calib.solve.validation.support import from_middle

#: A change shifts the corners by less than this many times what the shots before and after, fitted alone, say.
_CONFIRMED = 2.0


def is_confirmed(solution: Solution, change: Change) -> bool:
    """True if a camera fitted to the shots before a change of optics, and one to those after, differ by as much.

    The lens is held. A change is one linear step beside boards and lenses of any smooth shape: where some poses at the
    border of the image miss, because the lens does not fit there, that step can be of any size. Real changes, simulated
    and of real images, have 0.8 to 1.1 of the shift; cameras that never changed but had another lens, 4 to 65.
    """
    sensor, camera = solution.task.sensors[change.sensor], solution.cameras[change.sensor]
    held = replace(sensor, fixed=tuple({*sensor.fixed, *sensor.lens.coefficients, ASPECT}))
    views = [view for view in solution.task.corners if view.sensor == change.sensor]
    parts = [[view for view in views if (view.shot >= change.shot) is after] for after in (False, True)]
    try:
        before, after = (fit_camera(change.sensor, held, part, camera) for part in parts)
    except NotSolvedError:
        return False
    moved = np.array([after.cx - before.cx, after.cy - before.cy])
    shifts = np.log(after.fx / before.fx) * from_middle(solution, change.sensor) + moved
    return change.shift_px < _CONFIRMED * rms(shifts)


def of_place(one: Change) -> str:
    """A sensor that moved."""
    turn, move = np.linalg.norm(one.values[:3]), np.linalg.norm(one.values[3:])
    return (
        f"{one.sensor}: stands elsewhere from about shot {one.shot} on, by about {rounded(float(move) * 1e3)} mm and "
        f"{rounded(float(np.degrees(turn)))}°, which shifts its corners by {rounded(one.shift_px)} px: it or the "
        "reference was moved; fasten the sensors, and leave out the shots before or after with --skip"
    )


def of_optics(one: Change, sensors: int) -> str:
    """A sensor that was refocused; `sensors` in the rig."""
    focal, across, down = one.values.tolist()
    cause = "it was refocused, zoomed or moved: fasten the sensors," if sensors > 1 else "it was refocused or zoomed:"
    return (
        f"{one.sensor}: projects otherwise from about shot {one.shot} on: focal length by {focal:+.1%}, principal "
        f"point by ({across:+.1f}, {down:+.1f}) px, which shifts its corners by {rounded(one.shift_px)} px: {cause} "
        "switch autofocus, zoom and image stabilisation off, and leave out the shots before or after with --skip; if "
        "nothing changed but where the boards were, the kind of lens fits nearly only, or the board is bent"
    )


def unexplained(one: Change) -> str:
    """Shots that disagree with those before, though their optics are the same."""
    return (
        f"{one.sensor}: shots from about {one.shot} on disagree with those before, and not by another focal length or "
        "principal point: the kind of lens does not fit where their boards were, or the board is bent; try another "
        "kind of lens, and look at these shots"
    )


def of_focus(sensor: str, deviation: float) -> str:
    """A focal length that differs from shot to shot, by a deviation [1]."""
    return (
        f"{sensor}: its focal length differs by ± {deviation:.1%} from shot to shot: switch autofocus, zoom and image "
        "stabilisation off; if they are, make sure of a flat board and even, sharp images, and try another kind of lens"
    )


def unseen(hidden: Mapping[str, float]) -> str:
    """Sentence on the least changes of focal lengths [1] that would have shown, by sensor; "" without any."""
    if not hidden:
        return ""
    sensor = max(hidden, key=lambda name: hidden[name])
    of = f"the focal length of {sensor}" if len(hidden) > 1 else "its focal length"
    size = f" of less than {max(hidden[sensor], 0.001):.1%}" if np.isfinite(hidden[sensor]) else ""
    return f" A change of {of} half way{size} would not have shown."

"""Depth terms that the shots hardly hold, in words: distances that are long look like a sensor that stands elsewhere.

Parameters are expressed by the displacement that they cause at the scene's distance [m]. The eigenvector of a sensor's
depth terms with the largest variance, with the parameters that it changes, leaves all residuals nearly as they are.
"""

import numpy as np
from scipy import linalg

from calib.solve.bundle.parameters.layout import DEPTH_TERMS, POSE
from calib.solve.rounding import rounded
from calib.solve.solution import Solution

#: Directions are weak if they are known to less than this share of the distance (95 %).
WEAK = 0.005

#: Parameters with at least this share of a direction are named.
SHARE = 0.3

_WORDS = {"depth_offset": "the offset of its distances", "depth_scale": "the scale of its distances"}


def weak_directions(solution: Solution, distance: float) -> list[str]:
    """Reasons to doubt depth terms, each with a remedy; none if they are held at a distance [m] or not free."""
    layout = solution.adjustment.layout
    chosen = [(sensor, name) for sensor, free in layout.free_parameters.items() for name in free.names if _is_of(name)]
    columns = [int(layout.columns(sensor, [name])[0]) for sensor, name in chosen]
    moved = np.array([distance if _is_relative(name) else 1.0 for _, name in chosen])
    covariance = solution.covariance[np.ix_(columns, columns)] * np.outer(moved, moved)
    found = []
    for sensor, free in layout.free_parameters.items():
        own = [chosen.index((sensor, name)) for name in free.depth]
        if not own:
            continue
        variances, directions = linalg.eigh(covariance[np.ix_(own, own)])
        reach = 1.96 * float(np.sqrt(max(variances[-1], 0.0)))
        if reach > WEAK * distance:
            # What all parameters change by where the depth terms change along their weakest direction.
            changes = covariance[:, own] @ directions[:, -1] / variances[-1]
            parts = dict(zip(chosen, changes.tolist(), strict=True))
            found.append(_reason(_named(solution, parts), parts, reach, distance))
    return found


def _is_of(name: str) -> bool:
    return name in POSE or name in DEPTH_TERMS


def _is_relative(name: str) -> bool:
    """True for parameters that move points by their distance times their value."""
    return name == "depth_scale" or name.startswith("rotation")


def _named(solution: Solution, parts: dict[tuple[str, str], float]) -> dict[str, list[str]]:
    """Parameters that a direction changes, in words, by sensor."""
    named: dict[str, list[str]] = {}
    for sensor in dict.fromkeys(sensor for sensor, _ in parts):
        own = {name: value for (owner, name), value in parts.items() if owner == sensor}
        words = [_WORDS[name] for name in DEPTH_TERMS if abs(own.get(name, 0.0)) > SHARE]
        if "x" in own:
            words += _of_pose(solution, sensor, own)
        if words:
            named[sensor] = words
    return named


def _reason(named: dict[str, list[str]], parts: dict[tuple[str, str], float], reach: float, distance: float) -> str:
    changes = "; ".join(f"{sensor}: {', '.join(words)}" for sensor, words in named.items())
    fixed = " ".join(f"--fixed-pose {sensor}" for sensor in named if (sensor, "x") in parts)
    remedy = f", or keep a pose that is known ({fixed})" if fixed else ""
    return (
        f"{changes}: held by the shots to {rounded(reach * 1e3)} mm only (95 %, at {distance:g} m), as one looks like "
        f"the other; show the board at more distances, from near to far{remedy}"
    )


def _of_pose(solution: Solution, sensor: str, own: dict[str, float]) -> list[str]:
    """Parts of a sensor's pose with a large share, in the sensor's own frame."""
    axes = solution.cameras[sensor].T_rs[:3, :3]
    turn = np.array([own[name] for name in POSE[:3]]) @ axes
    move = np.array([own[name] for name in POSE[3:]]) @ axes
    words = ["its position along the view"] if abs(move[2]) > SHARE else []
    words += ["its position across the view"] if np.hypot(move[0], move[1]) > SHARE else []
    return words + (["its direction"] if np.linalg.norm(turn) > SHARE else [])

"""Hypotheses of a rig's change since its calibration, as directions in its sensors' parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from calib.calibration_check.stored_calibration import Stored
from calib.camera import Camera
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, POSE

#: Deviations of what happens to a sensor: moved by 0.1 rad and 0.1 m, distances changed by 5 cm and 5 %.
PRIOR: Mapping[str, float] = dict(zip((*POSE, *DEPTH_TERMS), (0.1,) * 6 + (0.05, 0.05), strict=True))

#: Deviations of a board's size from its description, and of a focal length from the stored one.
BOARD_PRIOR, FOCAL_PRIOR = 0.05, 0.05


class Kind(Enum):
    """Kinds of change."""

    UNCHANGED = "unchanged"
    MOVED = "moved"
    ALIGNMENT = "alignment"
    SCALE = "depth scale"
    OFFSET = "depth offset"
    BOTH = "depth scale and offset"
    FOCAL = "focal length"
    BOARD = "size of the board"
    SEVERAL = "several changes"


#: Terms of distances that each kind changes.
TERMS = {
    Kind.SCALE: ("depth_scale",),
    Kind.OFFSET: ("depth_offset",),
    Kind.BOTH: ("depth_scale", "depth_offset"),
}


@dataclass(frozen=True)
class Hypothesis:
    """One thing that may have happened.

    Attributes:
        kind: of change.
        sensors: to which; several that move together, or none.
        columns: changes that it allows, by position in the names of all changes; those of sensors that move together
            are rows, otherwise there is one row.
        factors: by which the only parameter changes each row; empty if by 1 as every other parameter.
    """

    kind: Kind
    sensors: tuple[str, ...] = ()
    columns: tuple[tuple[int, ...], ...] = ()
    factors: tuple[float, ...] = ()

    def contains(self, other: "Hypothesis") -> bool:
        """True if it allows all changes of another one, and more."""
        own, less = ({column for row in each.columns for column in row} for each in (self, other))
        return (less < own or self.kind == Kind.SEVERAL) and self.kind not in (Kind.BOARD, other.kind)

    def units(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Prior deviations of its parameters (k,) [rad, m, 1]."""
        if self.factors:
            return np.array([FOCAL_PRIOR if self.kind == Kind.FOCAL else BOARD_PRIOR])
        return np.array([PRIOR[names[column].rpartition(".")[2]] for own in self.columns[:1] for column in own])

    def basis(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Changes (n, k) of all names by one prior deviation of each of its parameters."""
        units = self.units(names)
        found = np.zeros((len(names), len(units)))
        for own, factor in zip(self.columns, self.factors or (1.0,) * len(self.columns), strict=True):
            found[own, np.arange(len(own))] = factor * units
        return found


def hypotheses(stored: Stored, names: Sequence[str]) -> list[Hypothesis]:
    """All hypotheses, from nothing changed to everything.

    A depth image that was aligned to another sensor's image has the camera of that sensor: the two cannot move apart,
    but the alignment may be wrong, and they move together.

    Args:
        stored: the calibration.
        names: of the changes that the views can show, such as `tof.x`; of intrinsics among them, only both focal
            lengths change, by one factor.
    """
    sensors = [*dict.fromkeys(name.rpartition(".")[0] for name in names)]
    found = [Hypothesis(Kind.UNCHANGED)]
    bodies = _bodies(stored, sensors)
    if len(bodies) > 1:
        found += [_hypothesis(Kind.MOVED, body, POSE, names) for body in bodies]
    for body in bodies:
        found += [_hypothesis(Kind.ALIGNMENT, (name,), POSE, names) for name in body[1:]]
    for name in sensors:
        if f"{name}.depth_scale" in names:
            found += [_hypothesis(kind, (name,), terms, names) for kind, terms in TERMS.items()]
        if {f"{name}.fx", f"{name}.fy"} <= {*names}:
            camera = stored.sensors[name].camera
            both = _hypothesis(Kind.FOCAL, (name,), ("fx", "fy"), names).columns[0]
            found.append(Hypothesis(Kind.FOCAL, (name,), tuple((one,) for one in both), (camera.fx, camera.fy)))
    every = tuple(column for column, name in enumerate(names) if name.rpartition(".")[2] in PRIOR)
    return [*found, Hypothesis(Kind.SEVERAL, tuple(sensors), (every,))]


def board(stored: Stored, names: Sequence[str], size: float = 1.0) -> Hypothesis:
    """The hypothesis of a board of another size than described, by which all sensors seem to change together.

    Seen by a board that is larger by a factor k than described, all sensors stand nearer to each other by 1 / k and
    measure distances that are longer by k. The parameter is 1 - 1 / k.

    Args:
        stored: the calibration.
        names: of the changes that the views can show.
        size: approximate k, about which distances are linear.
    """
    changes: dict[int, float] = {}
    for column, name in enumerate(names):
        sensor, _, term = name.rpartition(".")
        state = stored.sensors[sensor]
        if term in POSE[3:]:
            changes[column] = -float(state.camera.T_rs[POSE[3:].index(term), 3])
        elif term == "depth_scale":
            changes[column] = size * (1 + state.depth_scale)
    return Hypothesis(Kind.BOARD, (), tuple((column,) for column in changes), tuple(changes.values()))


def _hypothesis(kind: Kind, sensors: tuple[str, ...], terms: Sequence[str], names: Sequence[str]) -> Hypothesis:
    return Hypothesis(kind, sensors, tuple(tuple(names.index(f"{name}.{term}") for term in terms) for name in sensors))


def _bodies(stored: Stored, sensors: Sequence[str]) -> list[tuple[str, ...]]:
    """Sensors that share a camera and a pose, together; first those with corners, as in the names."""
    bodies: list[tuple[str, ...]] = []
    for name in sensors:
        same = [body for body in bodies if _is_same(stored.sensors[body[0]].camera, stored.sensors[name].camera)]
        if same:
            bodies[bodies.index(same[0])] = (*same[0], name)
        else:
            bodies.append((name,))
    return bodies


def _is_same(one: Camera, other: Camera) -> bool:
    keys = ("width", "height", "fx", "fy", "cx", "cy")
    return all(getattr(one, key) == getattr(other, key) for key in keys) and np.allclose(
        one.T_rs, other.T_rs, atol=1e-6
    )

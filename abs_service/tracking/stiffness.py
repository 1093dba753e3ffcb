"""Bending stiffness of a strip from how it hangs: the heavy elastica that fits the tracked inclinations of many frames.

The beam model is that of `elastica`: D κ(s) is the moment of all that hangs beyond s (W. G. Bickley, The heavy
elastica, Phil. Mag. 17, 1934), for slopes of any size. Only the ratio of weight and stiffness has a shape, so the
weight must be known. What the model assumes: the strip is uniform, straight without load, and moves so slowly that it
hangs at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.elastica import heavy_elastica
from abs_service.tracker.models.gravity import Gravity

Vector = NDArray[np.float64]

#: Successive frames have correlated errors; the scatter of the load is estimated from so many blocks of frames.
STRETCHES = 8

#: With fewer frames nothing can be said about how they scatter.
LEAST_FRAMES = 5 * STRETCHES

#: Loads w L³ / D that can be told from none, and from a thread.
LEAST_LOAD, MOST_LOAD = 1e-3, 300.0

#: Nobody knows better how a gripper is inclined, even if the model takes it for fixed [rad].
LEAST_DEVIATION = 1e-3

#: Step of the numerical derivatives [rad], and relative step of the load.
STEP = 1e-4

#: The search for the load ends with a step of its logarithm below this, or after so many steps.
CONVERGED, MOST_STEPS = 1e-7, 60


class StiffnessError(ValueError):
    """Nothing can be said about the stiffness; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class InclinationProfile:
    """The strip in one frame.

    Attributes:
        inclination: angle from the horizontal (segments + 1,) at the ends of the segments, from the gripper on [rad].
        covariance: of these angles [rad²].
    """

    inclination: Vector
    covariance: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stiffness:
    """What the frames say.

    Attributes:
        load: weight per area times length cubed over stiffness per width; no unit.
        deviation: standard deviation of the load's logarithm: that of all parts together.
        scatter: the part of it that is told from how stretches of the recording differ.
        from_length: the part of it that comes from the strip's length.
        from_first: the part of it that comes from how the strip hung when it was found.
        misfit: mean squared residual of the inclinations, in their own variances: about 1 if the beam model holds.
        frames: number of frames used.
    """

    load: float
    deviation: float
    scatter: float
    from_length: float
    from_first: float
    misfit: float
    frames: int

    def bending(self, weight: float, length: float) -> float:
        """Bending stiffness per width D [N·m] of a strip of a weight per area [N/m²] and a length [m]."""
        return weight * length**3 / self.load


def inclination_profile(model: Gravity, theta: Vector, covariance: NDArray[np.float64]) -> InclinationProfile:
    """The inclinations of tracked parameters (dim,) with their covariance (dim, dim)."""
    offsets = STEP * np.eye(len(theta))
    slopes = np.stack(
        [(model.inclination(theta + step) - model.inclination(theta - step)) / (2 * STEP) for step in offsets], axis=1
    )
    least = LEAST_DEVIATION**2 * np.eye(model.segments + 1)
    return InclinationProfile(model.inclination(theta), slopes @ covariance @ slopes.T + least)


def estimate_stiffness(
    frames: Sequence[InclinationProfile], length: float, length_deviation: float, first_deviation: float
) -> Stiffness:
    """Fits one load to all frames, each with an inclination of its own.

    What the strip looks like is told from the frame in which it was found, with the shape that it seemed to have there.
    Colours hold on to that shape in all frames, so they share its error.

    Args:
        frames: in the order of time.
        length: of the strip [m].
        length_deviation: standard deviation of the length [m]; the load grows with its third power.
        first_deviation: standard deviation of the logarithm of the load that the first frame seemed to show.

    Raises:
        StiffnessError: too few frames, or a strip that does not bend, or that hangs like a thread.
    """
    if len(frames) < LEAST_FRAMES:
        raise StiffnessError(f"{len(frames)} frames with a tracked strip are too few, at least {LEAST_FRAMES} needed")
    fit = _fit(frames)
    borders = np.linspace(0, len(frames), STRETCHES + 1).astype(int)
    parts = [_fit(frames[first:last]).log_load for first, last in pairwise(borders)]
    # The variance of Student's distribution with one degree of freedom less than there are stretches.
    wide = np.sqrt((STRETCHES - 1) / (STRETCHES - 3))
    scatter = max(wide * float(np.std(parts, ddof=1) / np.sqrt(STRETCHES)), fit.deviation)
    from_length = 3 * length_deviation / length
    deviation = float(np.linalg.norm([scatter, from_length, first_deviation]))
    load = float(np.exp(fit.log_load))
    return Stiffness(load, deviation, scatter, from_length, first_deviation, fit.misfit, len(frames))


def predicted_tip(load: float, frame: InclinationProfile) -> float:
    """Inclination at the free end [rad] that goes with a load and fits a frame best."""
    inclination, weights = frame.inclination, np.linalg.inv(frame.covariance)
    tip = inclination[-1:]
    for _ in range(10):
        by_tip = _by_tip(tip, load, len(inclination))[0]
        residual = inclination - _shapes(tip, load, len(inclination))[0]
        tip = tip + (by_tip @ weights @ residual) / (by_tip @ weights @ by_tip)
    return float(tip[0])


@dataclass(frozen=True, slots=True)
class _Fit:
    """Logarithm of the load, its deviation if the frames were independent, and the misfit as in `Stiffness`."""

    log_load: float
    deviation: float
    misfit: float


def _fit(frames: Sequence[InclinationProfile]) -> _Fit:
    """Gauss and Newton's method for one load and an inclination of every frame, which is eliminated."""
    inclination = np.stack([frame.inclination for frame in frames])
    weights = np.linalg.inv(np.stack([frame.covariance for frame in frames])).astype(np.float64)
    count = inclination.shape[1]
    tip, log_load, information, residual = inclination[:, -1], 0.0, 1.0, inclination
    for _ in range(MOST_STEPS):
        load = float(np.exp(log_load))
        residual, by_tip = inclination - _shapes(tip, load, count), _by_tip(tip, load, count)
        by_load = (_shapes(tip, load * (1 + STEP), count) - _shapes(tip, load * (1 - STEP), count)) / (2 * STEP)
        tip_tip, tip_load, load_load = (
            _product(a, weights, b) for a, b in ((by_tip, by_tip), (by_tip, by_load), (by_load, by_load))
        )
        tip_rest, load_rest = _product(by_tip, weights, residual), _product(by_load, weights, residual)
        information = float(np.sum(load_load - tip_load**2 / tip_tip))
        step = float(np.clip(np.sum(load_rest - tip_load * tip_rest / tip_tip) / information, -0.5, 0.5))
        tip = tip + np.clip((tip_rest - tip_load * step) / tip_tip, -0.3, 0.3)
        log_load += step
        if not np.log(LEAST_LOAD) < log_load < np.log(MOST_LOAD):
            raise StiffnessError(
                f"the load w L³/D leaves the range {LEAST_LOAD:g} … {MOST_LOAD:g}: the strip bends too little, or "
                f"hangs like a thread; a longer or shorter piece of it tells more"
            )
        if abs(step) < CONVERGED:
            break
    misfit = float(np.mean(_product(residual, weights, residual)) / (count - 1))
    return _Fit(log_load, float(1 / np.sqrt(information)), misfit)


def _product(a: NDArray[np.float64], weights: NDArray[np.float64], b: NDArray[np.float64]) -> Vector:
    """aᵀ W b of every frame (frames,)."""
    return np.einsum("fi,fij,fj->f", a, weights, b)


def _by_tip(tip: Vector, load: float, count: int) -> NDArray[np.float64]:
    return (_shapes(tip + STEP, load, count) - _shapes(tip - STEP, load, count)) / (2 * STEP)


def _shapes(tip: Vector, load: float, count: int) -> NDArray[np.float64]:
    """Inclinations (frames, count) at equal steps from the gripper to the free end."""
    nodes = heavy_elastica(tip, load).inclination
    place = np.linspace(0, nodes.shape[1] - 1, count)
    left = np.minimum(place.astype(int), nodes.shape[1] - 2)
    return nodes[:, left] + (place - left) * (nodes[:, left + 1] - nodes[:, left])

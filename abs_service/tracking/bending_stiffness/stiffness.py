"""Bending stiffness of a hanging strip: fit of the heavy elastica to the tracked inclinations of many frames.

The beam model is that of `elastica`: D κ(s) is the moment of the weight beyond s (W. G. Bickley, The heavy elastica,
Phil. Mag. 17, 1934), for slopes of any size. The shape determines only the ratio of weight and stiffness, so the weight
must be given. Assumptions: the strip is uniform, straight without load, and quasi-static.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.strip.elastica import heavy_elastica
from abs_service.tracker.models.gravity import Gravity

Vector = NDArray[np.float64]

#: Number of blocks of frames from which the scatter of the load is estimated, because errors of successive frames are
#: correlated.
STRETCHES = 8

#: Minimum number of frames for an estimate of their scatter.
MIN_FRAMES = 5 * STRETCHES

#: Range of loads w L³ / D that can be distinguished from zero load and from a thread.
MIN_LOAD, MAX_LOAD = 1e-3, 300.0

#: Lower bound of the standard deviation of the gripper's inclination, even if the model keeps it fixed [rad].
MIN_DEVIATION = 1e-3

#: Step of the numerical derivatives [rad], and relative step of the load.
STEP = 1e-4

#: Termination of the search for the load: largest step of its logarithm, and maximum number of steps.
CONVERGED, MAX_STEPS = 1e-7, 60


class StiffnessError(ValueError):
    """The stiffness cannot be estimated; the message contains the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class InclinationProfile:
    """Inclination of the strip in one frame.

    Attributes:
        inclination: angle from the horizontal at the ends of the segments (segments + 1,), gripper first [rad].
        covariance: covariance of these angles (segments + 1, segments + 1) [rad²].
    """

    inclination: Vector
    covariance: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Estimated load of a strip with its uncertainty.

    Attributes:
        load: weight per area times length cubed over stiffness per width; no unit.
        deviation: standard deviation of the load's logarithm, combined from the following parts.
        scatter: contribution of the scatter between blocks of the recording.
        from_length: contribution of the uncertain length of the strip.
        from_first: contribution of the uncertain shape of the strip at its detection.
        misfit: mean squared residual of the inclinations, normalised by their covariance: about 1 if the beam model
            holds.
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
        """Bending stiffness per width D [N·m] for a weight per area [N/m²] and a length [m]."""
        return weight * length**3 / self.load


def inclination_profile(model: Gravity, theta: Vector, covariance: NDArray[np.float64]) -> InclinationProfile:
    """Inclinations and their covariance, propagated from theta (dim,) and its covariance (dim, dim)."""
    offsets = STEP * np.eye(len(theta))
    jacobian = np.stack(
        [(model.inclination(theta + step) - model.inclination(theta - step)) / (2 * STEP) for step in offsets], axis=1
    )
    minimum = MIN_DEVIATION**2 * np.eye(model.segments + 1)
    return InclinationProfile(model.inclination(theta), jacobian @ covariance @ jacobian.T + minimum)


def estimate_stiffness(
    frames: Sequence[InclinationProfile], length: float, length_deviation: float, first_deviation: float
) -> Stiffness:
    """Fits one load to all frames, with a separate inclination at the free end per frame.

    The appearance is sampled on the shape detected in the first frame. The colours tie all frames to that shape, so
    its error is common to all of them.

    Args:
        frames: in temporal order.
        length: length of the strip [m].
        length_deviation: standard deviation of the length [m]; the load grows with its third power.
        first_deviation: standard deviation of the logarithm of the load fitted to the first frame.

    Raises:
        StiffnessError: too few frames, or the strip does not bend, or hangs like a thread.
    """
    if len(frames) < MIN_FRAMES:
        raise StiffnessError(f"{len(frames)} frames with a tracked strip are too few, at least {MIN_FRAMES} needed")
    fit = _fit(frames)
    borders = np.linspace(0, len(frames), STRETCHES + 1).astype(int)
    parts = [_fit(frames[first:last]).log_load for first, last in pairwise(borders)]
    # Standard deviation of Student's t distribution with STRETCHES − 1 degrees of freedom.
    wide = np.sqrt((STRETCHES - 1) / (STRETCHES - 3))
    scatter = max(wide * float(np.std(parts, ddof=1) / np.sqrt(STRETCHES)), fit.deviation)
    from_length = 3 * length_deviation / length
    deviation = float(np.linalg.norm([scatter, from_length, first_deviation]))
    load = float(np.exp(fit.log_load))
    return Stiffness(load, deviation, scatter, from_length, first_deviation, fit.misfit, len(frames))


def predicted_tip(load: float, frame: InclinationProfile) -> float:
    """Inclination at the free end [rad] that best fits a frame, for a given load."""
    inclination, weights = frame.inclination, np.linalg.inv(frame.covariance)
    tip = inclination[-1:]
    for _ in range(10):
        by_tip = _by_tip(tip, load, len(inclination))[0]
        residual = inclination - _shapes(tip, load, len(inclination))[0]
        tip = tip + (by_tip @ weights @ residual) / (by_tip @ weights @ by_tip)
    return float(tip[0])


@dataclass(frozen=True, slots=True)
class _Fit:
    """Logarithm of the load, its deviation for independent frames, and the misfit as in `Stiffness`."""

    log_load: float
    deviation: float
    misfit: float


def _fit(frames: Sequence[InclinationProfile]) -> _Fit:
    """Gauss-Newton for one load and one inclination per frame, which is eliminated (Schur complement)."""
    inclination = np.stack([frame.inclination for frame in frames])
    weights = np.linalg.inv(np.stack([frame.covariance for frame in frames])).astype(np.float64)
    count = inclination.shape[1]
    tip, log_load, information, residual = inclination[:, -1], 0.0, 1.0, inclination
    for _ in range(MAX_STEPS):
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
        if not np.log(MIN_LOAD) < log_load < np.log(MAX_LOAD):
            raise StiffnessError(
                f"the load w L³/D leaves the range {MIN_LOAD:g} … {MAX_LOAD:g}: the strip bends too little, or "
                f"hangs like a thread; a longer or shorter piece of it tells more"
            )
        if abs(step) < CONVERGED:
            break
    misfit = float(np.mean(_product(residual, weights, residual)) / (count - 1))
    return _Fit(log_load, float(1 / np.sqrt(information)), misfit)


def _product(a: NDArray[np.float64], weights: NDArray[np.float64], b: NDArray[np.float64]) -> Vector:
    """Product aᵀ W b of every frame (frames,)."""
    return np.einsum("fi,fij,fj->f", a, weights, b)


def _by_tip(tip: Vector, load: float, count: int) -> NDArray[np.float64]:
    return (_shapes(tip + STEP, load, count) - _shapes(tip - STEP, load, count)) / (2 * STEP)


def _shapes(tip: Vector, load: float, count: int) -> NDArray[np.float64]:
    """Inclinations (frames, count) at equal steps from the gripper to the free end."""
    nodes = heavy_elastica(tip, load).inclination
    place = np.linspace(0, nodes.shape[1] - 1, count)
    left = np.minimum(place.astype(int), nodes.shape[1] - 2)
    return nodes[:, left] + (place - left) * (nodes[:, left + 1] - nodes[:, left])

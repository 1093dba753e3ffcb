"""Sequences that show the same scene from the same place: they count as one.

Files that are given twice, or recordings of one scene, share the systematic errors of that place. Held out from each
other they would confirm whatever is fitted to them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots import sequences as recorded
from calib.noise.base import NoiseError
from calib.sequences.static_board import StaticBoard
from calib.sequences.stillness import MIN_FRAMES

Target = float | StaticBoard

#: Means of two sequences that are one scene differ by less than this share of the scatter in time, …
_SCATTER = 0.5
#: … or by what chance makes of few frames: the median of a normal variable, 0.67 σ, and a margin.
_CHANCE = 1.0
#: Amplitudes of one scene differ by less than this share; another material at the same distance is another scene.
_BRIGHTER = 0.05
#: Fraction of the pixels that must measure in both, and every how manyth row and column is compared.
_BOTH, _EVERY = 0.1, 2


@dataclass(frozen=True, eq=False)
class _Summary:
    """Mean, scatter in time and amplitude of the compared pixels of a sequence, NaN where it measures nothing."""

    frames: int
    mean: NDArray[np.float64]
    sigma: NDArray[np.float64]
    amplitude: NDArray[np.float64]


def counted_once(
    given: Sequence[tuple[recorded.Sequence, Target]],
) -> tuple[list[tuple[recorded.Sequence, Target]], list[str]]:
    """Sequences of one scene joined to one, with the target of the first; and a sentence about each join.

    Args:
        given: sequences of one sensor, each with its target: depth [m], NaN if unknown, or the pose of a board.

    Raises:
        NoiseError: one scene is said to be at two distances, or images repeat each other too often.
    """
    different = [_different(one) for one, _ in given]
    said = [text for _, text in different if text]
    given = [(one, target) for (one, _), (_, target) in zip(different, given)]
    groups: list[list[int]] = []
    summaries = [_summary(one) for one, _ in given]
    for number, summary in enumerate(summaries):
        same = next((group for group in groups if _is_same(summaries[group[0]], summary)), None)
        if same is None:
            groups.append([number])
        else:
            _require_same_distance(given[same[0]], given[number])
            same.append(number)
    joined = [
        (_joined([given[number][0] for number in group]) if len(group) > 1 else given[group[0]][0], given[group[0]][1])
        for group in groups
    ]
    said += [
        f"{', '.join(given[number][0].name for number in group)} show the same scene, and count as one sequence"
        for group in groups
        if len(group) > 1
    ]
    return joined, said


def _different(one: recorded.Sequence) -> tuple[recorded.Sequence, str]:
    """The sequence without images that repeat the one before, as of a camera that is read too often, and what is said.

    That is "" without any.
    """
    count = len(one.lengths)
    new = [
        number
        for number, image in enumerate(one.lengths)
        if not number or image.tobytes() != one.lengths[number - 1].tobytes()
    ]
    if len(new) == count:
        return one, ""
    said = f"{one.name}: {count - len(new)} of {count} images repeat the one before, and are left out"
    if len(new) < MIN_FRAMES:
        raise NoiseError(f"{said}: fewer than {MIN_FRAMES} are left")
    return replace(one, lengths=one.lengths[new], amplitude=one.amplitude[new]), said


def _summary(one: recorded.Sequence) -> _Summary:
    lengths, amplitude = (part[:, ::_EVERY, ::_EVERY].astype(np.float64) for part in (one.lengths, one.amplitude))
    mean = _mean(lengths)
    return _Summary(len(lengths), mean, np.sqrt(_mean((lengths - mean) ** 2)), _mean(amplitude))


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the frames (height, width) of the measurements, NaN without any."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.where(count, np.where(known, values, 0).sum(axis=0) / np.maximum(count, 1), np.nan)


def _is_same(one: _Summary, other: _Summary) -> bool:
    if one.mean.shape != other.mean.shape:
        return False
    both = np.isfinite(one.mean + other.mean)
    if both.mean() < _BOTH:
        return False
    sigma = float(np.median(np.maximum(one.sigma, other.sigma)[both]))
    apart = float(np.median(np.abs(one.mean - other.mean)[both]))
    if apart > sigma * max(_SCATTER, _CHANCE * math.sqrt(1 / one.frames + 1 / other.frames)):
        return False
    bright = np.isfinite(one.amplitude + other.amplitude)
    if not bright.any():
        return True
    change = float(np.median(np.abs(one.amplitude - other.amplitude)[bright]))
    return change <= _BRIGHTER * float(np.median(one.amplitude[bright]))


def _require_same_distance(one: tuple[recorded.Sequence, Target], other: tuple[recorded.Sequence, Target]) -> None:
    first, second = one[1], other[1]
    if isinstance(first, float) and isinstance(second, float) and abs(first - second) > 0:
        raise NoiseError(
            f"{one[0].name} and {other[0].name} show the same scene, but are said to be {first:g} and {second:g} m away"
        )


def _joined(same: Sequence[recorded.Sequence]) -> recorded.Sequence:
    """One sequence of all different frames."""
    seen: set[int] = set()
    lengths, amplitudes = [], []
    for number, one in enumerate(same):
        for length, amplitude in zip(one.lengths, one.amplitude, strict=True):
            key = hash(length.tobytes())
            if key not in seen or number == 0:
                lengths.append(length)
                amplitudes.append(amplitude)
            seen.add(key)
    if len(lengths) == len(same[0].lengths):
        return same[0]
    return replace(same[0], lengths=np.stack(lengths), amplitude=np.stack(amplitudes))

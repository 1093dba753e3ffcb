"""Estimation of a depth sensor's noise model from static sequences, for `abs-service calibrate noise`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots import sequences as recorded
from calib.noise.base import DepthNoise, NoiseError
from calib.noise.fit.polynomial import Span
from calib.noise.fit.samples import domain
from calib.sequences import missing, parts, reference
from calib.sequences.candidates import Candidate, of_image, of_places
from calib.sequences.evidence import Evidence, gather, together
from calib.sequences.parts import Parts
from calib.sequences.reference import Kind, Reference
from calib.sequences.selection import FOLDS, THOROUGH, Trial, alike_from, attempt, choose, lean
from calib.sequences.static import Static, reduce
from calib.sequences.static_board import StaticBoard
from calib.sequences.steps import Steps

#: Maximum number of frames kept as samples per sequence, and of samples in total.
_KEPT, _MAX_VALUES = 30, 40_000_000

#: Minimum fraction of the static pixels that a plane must cover to be the target.
_TARGET = 0.85

#: Refits of the targets' orientations after subtracting the model's mean offsets.
_TURNS = 2

#: Minimum ratio of largest to smallest distance for own offsets that vary with distance.
_SEVERAL = 1.3

#: Number of distance ranges in the table of error components of sequences without a target.
_BINS = 8

#: Ranges with fewer pixels have no row in that table.
_FEW = 100


@dataclass(frozen=True, eq=False)
class NoiseCalibration:
    """Result of a noise calibration.

    Attributes:
        statics: statistics of every sequence.
        references: true distances of every sequence.
        model: the noise model.
        chosen: the selected trial; `law` is the trial of its image model.
        trials: all trials.
        by_sequence: True if whole sequences were held out, false if only frames of them.
        rows: error components of every sequence or range of distances, with a name.
        pattern: fixed error of each pixel over all sequences, and its deviation (height, width) [m].
        z: normalised held-out residuals.
        distances, amplitudes: domain; the latter NaN without amplitudes.
        steps: quantisation of the distances.
        boards: board poses of every sequence; empty if the true distances have another source.
        missing: missing returns of every target, and their law.
    """

    statics: tuple[Static, ...]
    references: tuple[Reference, ...]
    model: DepthNoise
    chosen: Trial
    law: Trial
    trials: tuple[Trial, ...]
    by_sequence: bool
    rows: tuple[tuple[str, Parts], ...]
    pattern: tuple[NDArray[np.float64], NDArray[np.float64]]
    z: NDArray[np.float64]
    distances: Span
    amplitudes: Span
    steps: Steps
    boards: tuple[StaticBoard, ...]
    missing: missing.Missing

    @property
    def kind(self) -> Kind:
        """Source of the true distances."""
        return self.references[0].kind


def calibrate(
    sequences: Sequence[recorded.Sequence],
    targets: Sequence[float | StaticBoard],
    region: NDArray[np.bool_],
    generator: np.random.Generator,
    say: Callable[[str], None],
) -> NoiseCalibration:
    """Selects and fits a sensor's noise model from static sequences.

    Args:
        sequences: of one sensor.
        targets: for each, its depth on the optical axis [m], NaN if unknown, or the pose of a board.
        region: pixels (height, width) that may show a target.
        generator: for the plane search and subsampling.
        say: called with progress messages.

    Raises:
        NoiseError: no model can be estimated; names the reason.
    """
    statics = _reduced(sequences, say)
    references = _references(statics, targets, region, generator)
    offsets, steps = references[0].kind.tells_offset, _steps(statics)
    amplitudes = all(np.isfinite(static.brightness[static.still]).any() for static in statics)
    alike = alike_from(generator)
    trials = _tried(of_image(offsets, amplitudes, steps), _evidence(statics, references), alike, say)
    law = choose(trials)
    evidence = _evidence(statics, references := _turned(statics, references, law.candidate, generator))
    everything = lean(together(evidence), generator, THOROUGH)
    distances = domain(everything.samples.true)
    own_degree = int(_by_sequence(statics) and distances[1] > _SEVERAL * distances[0])
    maps = of_places(law.candidate, statics[0].mean.shape, own_degree) if references[0].kind.has_target else []
    again, *places = _tried([law.candidate, *maps], evidence, alike, say)
    chosen = choose([again, *places])
    say(f"fitting {chosen.candidate.name} to everything")
    of_all = law.candidate.fit(everything)
    return NoiseCalibration(
        statics=tuple(statics),
        references=tuple(references),
        model=chosen.candidate.fit(everything),
        chosen=chosen,
        law=again,
        trials=(*trials, *places),
        by_sequence=_by_sequence(statics),
        rows=_rows(statics, references, of_all),
        pattern=parts.pattern(statics, references, of_all),
        z=_held_out(chosen.candidate, evidence, generator),
        distances=distances,
        amplitudes=_amplitudes(everything.samples.amplitude),
        steps=steps,
        boards=tuple(one for one in targets if isinstance(one, StaticBoard)),
        missing=missing.learn(statics, references, targets, region),
    )


def _amplitudes(values: NDArray[np.float64]) -> Span:
    """Domain of the amplitudes; NaN without any."""
    known = values[np.isfinite(values)]
    return domain(known) if known.size else (math.nan, math.nan)


def _reduced(sequences: Sequence[recorded.Sequence], say: Callable[[str], None]) -> list[Static]:
    shapes = {sequence.lengths.shape[1:] for sequence in sequences}
    if len(shapes) > 1:
        raise NoiseError(f"the sequences have images of different sizes: {sorted(shapes)}")
    keep = min(_KEPT, _MAX_VALUES // (len(sequences) * math.prod(shapes.pop())))
    found = []
    for number, one in enumerate(sequences, start=1):
        say(f"{one.name}: what is static ({number} of {len(sequences)})")
        found.append(reduce(one.name, one.lengths, one.amplitude, one.camera.rays(), one.along, one.digit, keep))
    return found


def _references(
    statics: Sequence[Static],
    targets: Sequence[float | StaticBoard],
    region: NDArray[np.bool_],
    generator: np.random.Generator,
) -> list[Reference]:
    """Boards or known distances if given, else planes if every sequence has a large one, else temporal means."""
    boards = [one for one in targets if isinstance(one, StaticBoard)]
    if len(boards) == len(statics):
        return [reference.on_board(static, one, region) for static, one in zip(statics, boards)]
    depths = [math.nan if isinstance(one, StaticBoard) else one for one in targets]
    if all(map(math.isfinite, depths)):
        return [reference.known(static, depth, region, generator) for static, depth in zip(statics, depths)]
    try:
        planes = [reference.fitted(static, region, generator) for static in statics]
    except NoiseError:
        planes = []
    shares = [np.isfinite(one.distance).sum() / (static.still & region).sum() for static, one in zip(statics, planes)]
    if planes and min(shares) >= _TARGET:
        return planes
    return [reference.mean(static, region, generator) for static in statics]


def _turned(
    statics: Sequence[Static], references: list[Reference], law: Candidate, generator: np.random.Generator
) -> list[Reference]:
    """Targets at known distances, refitted alternately with the mean offsets of the image model."""
    for _ in range(_TURNS if references[0].kind is Kind.KNOWN else 0):
        model = law.fit(lean(together(_evidence(statics, references)), generator))
        references = [reference.subtract_mean_offset(one, static, model) for static, one in zip(statics, references)]
    return references


def _by_sequence(statics: Sequence[Static]) -> bool:
    return len(statics) >= FOLDS


def _evidence(statics: Sequence[Static], references: Sequence[Reference]) -> list[Evidence]:
    """Evidence by sequence in the order of distance, or by thirds of the frames if there are few sequences."""
    pairs = sorted(zip(statics, references), key=lambda pair: float(np.nanmedian(pair[1].distance)))
    if _by_sequence(statics):
        return [gather(static, one) for static, one in pairs]
    found = []
    for static, one in pairs:
        edges = np.linspace(0, len(static.distance), FOLDS + 1).astype(int)
        found += [gather(static, one, slice(first, last)) for first, last in pairwise(edges) if last > first]
    return found


def _tried(
    candidates: Sequence[Candidate],
    evidence: Sequence[Evidence],
    alike: Callable[[], np.random.Generator],
    say: Callable[[str], None],
) -> list[Trial]:
    found = []
    for number, candidate in enumerate(candidates, start=1):
        say(f"trying {candidate.name} ({number} of {len(candidates)})")
        found.append(attempt(candidate, evidence, alike()))
    return found


def _steps(statics: Sequence[Static]) -> Steps:
    growth = [static.steps.growth for static in statics if static.steps.growth > 0]
    most = len(growth) > len(statics) / 2
    return Steps(max(static.steps.digit for static in statics), float(np.median(growth)) if most else 0.0)


def _rows(statics: Sequence[Static], references: Sequence[Reference], law: DepthNoise) -> tuple[tuple[str, Parts], ...]:
    """Error components of every sequence with a target; else of ranges of distances."""
    pairs = list(zip(statics, references))
    if references[0].kind is not Kind.MEAN:
        return tuple((s.name, parts.separate(s, one, law, s.still)) for s, one in pairs)
    found = []
    for static, one in pairs:
        edges = np.geomspace(np.nanmin(one.distance), np.nanmax(one.distance) * (1 + 1e-9), _BINS + 1)
        for near, far in pairwise(edges):
            inside = static.still & (one.distance >= near) & (one.distance < far)
            if inside.sum() >= _FEW:
                name = f"{near:.2f} to {far:.2f} m"
                found.append((f"{static.name}, {name}", parts.separate(static, one, law, inside)))
    return tuple(found)


def _held_out(
    candidate: Candidate, evidence: Sequence[Evidence], generator: np.random.Generator
) -> NDArray[np.float64]:
    known = [part for number, part in enumerate(evidence) if number % FOLDS]
    unseen = together(evidence[::FOLDS]).samples
    model = candidate.fit(lean(together(known), generator)) if known else candidate.fit(together(evidence))
    unseen = unseen.returns(with_amplitude=model.uses_amplitude)
    x, a, p = unseen.true, unseen.amplitude, unseen.pixels
    return (unseen.residual - model.mean(x, a, p)) / model.deviation(x, a, p)

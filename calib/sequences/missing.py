"""Missing returns of a sequence: how often pixels that show its target delivered no distance."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import no_return
from calib.no_return import NoReturn
from calib.sequences import plane
from calib.sequences.reference import Kind, Reference
from calib.sequences.static import Static
from calib.sequences.static_board import StaticBoard

#: Pixels of one target that count as independent: what one loses, its neighbours and the next frames tend to lose.
EVIDENCE = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class MissingReturns:
    """Pixels that show the target of one sequence, whether or not they returned.

    Attributes:
        name: of the sequence.
        distance: of the target (n,) [m], radial.
        cosine: of incidence (n,).
        share: of the frames without a return (n,).
    """

    name: str
    distance: NDArray[np.float64]
    cosine: NDArray[np.float64]
    share: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Missing:
    """Missing returns of several targets.

    Attributes:
        targets: those of every sequence; none if it is unknown where targets are.
        law: probability of no return; the default without targets.
    """

    targets: tuple[MissingReturns, ...]
    law: NoReturn


def learn(
    statics: Sequence[Static],
    references: Sequence[Reference],
    targets: Sequence[float | StaticBoard],
    region: NDArray[np.bool_],
) -> Missing:
    """Missing returns of planar targets, and their law. Each target counts alike, however many pixels show it.

    A board is where its corners are; any other target fills the hull of the pixels that agree with its plane, but for
    static pixels on another surface.

    Args:
        statics: the sequences.
        references: their true distances; without planes, nothing is reported.
        targets: the board of each, if it is one.
        region: pixels (height, width) that may show a target.
    """
    if references[0].kind is Kind.MEAN:
        return Missing((), no_return.CAUTIOUS)
    seen = tuple(_missing_returns(*each, region) for each in zip(statics, references, targets))
    x, cosine, share = (
        np.concatenate([getattr(one, name) for one in seen]) for name in ("distance", "cosine", "share")
    )
    weight = np.concatenate([np.full(len(one.share), EVIDENCE / max(len(one.share), 1)) for one in seen])
    return Missing(seen, no_return.fit(x, cosine, share, weight))


def _missing_returns(
    static: Static, reference: Reference, target: float | StaticBoard, region: NDArray[np.bool_]
) -> MissingReturns:
    """Shares of missing returns of one planar target."""
    known = np.isfinite(reference.distance)
    area = target.inside if isinstance(target, StaticBoard) else _hull(known)
    shown = area & region & (known | ~static.still)
    rays = static.rays[shown]
    cosine = np.abs(rays @ reference.plane) / np.linalg.norm(reference.plane)
    share = 1 - static.returns[shown] / static.frames
    return MissingReturns(static.name, plane.radial(reference.plane, rays), cosine, share)


def _hull(pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Convex hull (height, width) of the pixels of a mask."""
    filled = np.zeros(pixels.shape, np.uint8)
    points = np.argwhere(pixels)[:, ::-1].astype(np.int32)
    if len(points):
        cv2.fillConvexPoly(filled, cv2.convexHull(points), 1)
    return filled > 0

"""Deformation models by their public names; docs/explanation/models.md describes them."""

from collections.abc import Sequence
from typing import Any

from abs_service.api.checks import ArgumentError
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.flexpad import Settings as FlexPad
from abs_service.tracker.models.gravity import Settings as Gravity
from abs_service.tracker.models.posed import Settings as Posed
from abs_service.tracker.models.rigid import Settings as Rigid
from abs_service.tracking.plan import ModelSettings

__all__ = ["FlexPad", "Gravity", "Nurbs", "Posed", "Rigid"]

_DEFAULT = nurbs.Settings()


def Nurbs(
    long: int | None = None,
    short: int | None = None,
    *,
    degree: int | None = None,
    weights: tuple[tuple[float, ...], ...] = _DEFAULT.weights,
    margin: float = _DEFAULT.margin,
    smoothing: float = _DEFAULT.smoothing,
    bend_deg: float = _DEFAULT.bend_deg,
) -> ModelSettings:
    """A NURBS surface of any smooth shape; theta lists x, y, z of its control points row by row [m].

    Args:
        long, short: control points along the object's long and short side, 3 to 12; without both of them, they are
            derived from the object's size and proportions, the bend, the mesh and the sensor's noise.
        degree: polynomial degree of the splines, 1 to 4; None: 3, or less if there are too few control points for it.
        weights: weight of every control point, a table of `long` rows and `short` columns; empty: all 1.
        margin: share of the object's size by which the rest surface extends beyond it on every side.
        smoothing: weight of the bending of the rest surface when it is fitted to the vertices.
        bend_deg: angle between the normals of the two ends of the long side that the surface can follow, if the control
            points are derived.

    Raises:
        ArgumentError: weights of another shape, or one of `long` and `short` without the other.
    """
    if (long is None) != (short is None):
        raise ArgumentError(f"long = {long}, short = {short}: give both, or neither")
    if not _is_table(weights):
        raise ArgumentError(f"weights = {weights!r}: must be a table, a row of numbers for each of `long`")
    try:
        return nurbs.Settings(
            "auto" if long is None or short is None else (long, short),
            "auto" if degree is None else degree,
            weights,
            margin,
            smoothing,
            bend_deg,
        )
    except ValueError as error:
        raise ArgumentError(f"Nurbs: {error}") from error


def _is_table(weights: Any) -> bool:
    """True for a sequence of sequences."""
    return isinstance(weights, Sequence) and all(isinstance(row, Sequence) for row in weights)

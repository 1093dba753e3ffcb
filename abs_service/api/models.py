"""Deformation models by their public names; docs/explanation/models.md describes them."""

from abs_service.tracker.models import nurbs
from abs_service.tracker.models.flexpad import Settings as FlexPad
from abs_service.tracker.models.gravity import Settings as Gravity
from abs_service.tracker.models.posed import Settings as Posed
from abs_service.tracker.models.rigid import Settings as Rigid

__all__ = ["FlexPad", "Gravity", "Nurbs", "Posed", "Rigid"]

_DEFAULT = nurbs.Settings()


def Nurbs(
    long: int | None = None,
    short: int | None = None,
    *,
    degree: int = _DEFAULT.degree,
    weights: tuple[tuple[float, ...], ...] = _DEFAULT.weights,
    margin: float = _DEFAULT.margin,
    smoothing: float = _DEFAULT.smoothing,
) -> nurbs.Settings:
    """A NURBS surface of any smooth shape; theta lists x, y, z of its control points row by row [m].

    Args:
        long, short: control points along the object's long and short side, 3 to 12; without both of them, they are
            derived from the object's proportions and the mesh.
        degree: polynomial degree of the splines, 1 to 4.
        weights: weight of every control point, a table of `long` rows and `short` columns; empty: all 1.
        margin: share of the object's size by which the rest surface extends beyond it on every side.
        smoothing: weight of the bending of the rest surface when it is fitted to the vertices.

    Raises:
        ValueError: weights of another shape, or one of `long` and `short` without the other.
    """
    if long is None and short is None:
        return nurbs.Settings("auto", degree, weights, margin, smoothing)
    if long is None or short is None:
        raise ValueError("long and short belong together: give both, or neither")
    return nurbs.Settings((long, short), degree, weights, margin, smoothing)

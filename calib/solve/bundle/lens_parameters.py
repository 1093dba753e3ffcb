"""The kinds of lenses that can be fitted: which coefficients each has, and how a lens is made of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib import fisheye, lens
from calib.fisheye import KannalaBrandt
from calib.lens import Lens, LensModel

#: The camera matrix, in the order of the parameters; the lens follows.
MATRIX = ("fx", "fy", "cx", "cy")


#: Deviation of coefficients that are held near zero. Numerator and denominator of a rational lens may share a factor,
#: which says nothing and can be anything; without this the search wanders along it for ever.
HELD = 2.0


@dataclass(frozen=True)
class LensKind:
    """A family of lenses.

    Attributes:
        name: what the command line and reports call it.
        every: names of all coefficients of such a lens.
        coefficients: names of those that are fitted, the first of all; the others stay as they are.
        make: the lens with given coefficients.
        held: names of coefficients that are held near zero; what they should be is known to about `HELD`.
        simpler: kinds to begin the search with, at most one.
    """

    name: str
    every: tuple[str, ...]
    coefficients: tuple[str, ...]
    make: Callable[[NDArray[np.float64]], LensModel]
    held: tuple[str, ...] = ()
    simpler: tuple["LensKind", ...] = ()


PINHOLE = LensKind("pinhole", lens.COEFFICIENTS, (), Lens)
BROWN_CONRADY = LensKind("brown-conrady", lens.COEFFICIENTS, lens.COEFFICIENTS[:5], Lens)
RATIONAL = LensKind("rational", lens.COEFFICIENTS, lens.COEFFICIENTS, Lens, ("k4", "k5", "k6"), (BROWN_CONRADY,))
FISHEYE = LensKind("fisheye", fisheye.COEFFICIENTS, fisheye.COEFFICIENTS, KannalaBrandt)

KINDS: Mapping[str, LensKind] = {kind.name: kind for kind in (PINHOLE, BROWN_CONRADY, RATIONAL, FISHEYE)}


def kind_of(fitted: LensModel) -> LensKind:
    """The kind that a given lens is of: the one with the fewest coefficients that can express it."""
    if isinstance(fitted, KannalaBrandt):
        return FISHEYE
    return RATIONAL if np.any(fitted.coefficients[len(BROWN_CONRADY.coefficients) :]) else BROWN_CONRADY

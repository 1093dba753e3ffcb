"""Lens models that can be fitted, with their coefficients."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.lenses import fisheye, lens
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensModel

#: Parameters of the camera matrix; lens coefficients follow.
MATRIX = ("fx", "fy", "cx", "cy")


#: Ratio of the focal lengths, fy / fx, among the intrinsics that can be fixed.
ASPECT = "aspect"

#: Standard deviation of the prior on regularised coefficients. Numerator and denominator of a rational lens may share a
#: common factor, which is unobservable; without a prior the search drifts along it.
PRIOR_SIGMA = 2.0


@dataclass(frozen=True)
class LensKind:
    """Family of lenses.

    Attributes:
        name: on the command line and in reports.
        every: names of all coefficients.
        coefficients: names of the fitted coefficients, a prefix of `every`; the others stay constant.
        make: constructs a lens from coefficients.
        regularized: names of coefficients with a prior of deviation `PRIOR_SIGMA` around zero.
        simpler: kind to initialise with; at most one.
    """

    name: str
    every: tuple[str, ...]
    coefficients: tuple[str, ...]
    make: Callable[[NDArray[np.float64]], LensModel]
    regularized: tuple[str, ...] = ()
    simpler: tuple["LensKind", ...] = ()

    @property
    def fixable(self) -> tuple[str, ...]:
        """Intrinsics of a camera with this lens that can be fixed."""
        return (*MATRIX, *self.coefficients, ASPECT)


PINHOLE = LensKind("pinhole", lens.COEFFICIENTS, (), Lens)
BROWN_CONRADY = LensKind("brown-conrady", lens.COEFFICIENTS, lens.COEFFICIENTS[:5], Lens)
RATIONAL = LensKind("rational", lens.COEFFICIENTS, lens.COEFFICIENTS, Lens, ("k4", "k5", "k6"), (BROWN_CONRADY,))
FISHEYE = LensKind("fisheye", fisheye.COEFFICIENTS, fisheye.COEFFICIENTS, KannalaBrandt)

KINDS: Mapping[str, LensKind] = {kind.name: kind for kind in (PINHOLE, BROWN_CONRADY, RATIONAL, FISHEYE)}


def kind_of(fitted: LensModel) -> LensKind:
    """Kind of a given lens with the fewest coefficients."""
    if isinstance(fitted, KannalaBrandt):
        return FISHEYE
    return RATIONAL if np.any(fitted.coefficients[len(BROWN_CONRADY.coefficients) :]) else BROWN_CONRADY

"""Lens models by the names that rig files, addresses and recordings use."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensError, LensModel

#: Values of `lens_model`.
LensName = Literal["brown_conrady", "fisheye"]


def lens_of(name: str, coefficients: ArrayLike) -> LensModel:
    """Lens of a model with its coefficients; missing trailing ones are zero.

    Raises:
        LensError: unknown model or invalid coefficients; names the allowed values.
    """
    numbers = np.asarray(coefficients, np.float64)
    match name:
        case Lens.name:
            return Lens(numbers)
        case KannalaBrandt.name:
            return KannalaBrandt(numbers)
    raise LensError(f'lens_model = "{name}" is none of {list(get_args(LensName))}')

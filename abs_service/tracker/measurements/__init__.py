"""Kinds of measurement, one per file: decoding of an image, synthesis and likelihood.

A module has `Noise`, the type of its noise models, and `Measurement`, which is made from one of them: a sensor finds
its kind by the type of its noise model. A module with `Settings` is a `type` of `noise` in rig files as well.
"""

import pkgutil
import sys
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, overload

from abs_service.tracker.measurements.base import MeasurementKind, PictureKind
from calib.noise.base import ImageNoise, NoiseError
from calib.rig import Noise


@overload
def measurement(noise: ImageNoise) -> PictureKind: ...
@overload
def measurement(noise: Noise) -> MeasurementKind: ...
def measurement(noise: Noise) -> MeasurementKind:
    """The kind of measurement that a noise model is about.

    Raises:
        NoiseError: it is of no kind.
    """
    for module in (*_installed(), *_own()):
        if isinstance(noise, module.Noise):
            return module.Measurement(noise)
    name = f"{type(noise).__module__}.{type(noise).__qualname__}"
    raise NoiseError(f"{name} is the noise of no kind of measurement; {__name__} has entry points for them")


@cache
def _own() -> tuple[Any, ...]:
    """The kinds of this package."""
    modules = [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    return tuple(module for module in modules if hasattr(module, "Measurement"))


def _installed() -> list[Any]:
    """The kinds that installed distributions declare, if anybody uses them: others have made no noise model."""
    return [sys.modules[name] for name in _declared() if name in sys.modules]


@cache
def _declared() -> tuple[str, ...]:
    return tuple(point.value for point in entry_points(group=__name__))

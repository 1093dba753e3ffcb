"""The fitness that the likelihood replaces: squared distances and colour differences with weights chosen by hand."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.objectives.base import TermSum
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import Bounds, SensorFit, Term
from abs_service.tracker.terms.color import ColorTerm
from abs_service.tracker.terms.depth import DepthTerm
from calib.noise.base import LOG_SQRT_2PI
from calib.noise.color import GaussianColor
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.rig import Rig, Sensor


@dataclass(frozen=True)
class Settings:
    """TOML keys of the Euclidean fitness: every pixel of every sensor counts alike, whatever its noise.

    A weighted square is the likelihood of one constant deviation, 1/√(2 weight), without a mean offset; so the same
    terms serve, and the sensors' own noise models are ignored.

    Attributes:
        depth_weight: cost of a squared metre between measured and synthesised distance.
        color_weight: cost of a squared level of colour difference, summed over the channels.
        cutoff_m: distances that differ by more, and vertices without a measurement, cost as much as this [m].
        cutoff_levels: likewise for colours, in levels of 256.
    """

    depth_weight: Annotated[float, Gt(0)] = 5000.0
    color_weight: Annotated[float, Gt(0)] = 0.002
    cutoff_m: Annotated[float, Gt(0)] = 0.03
    cutoff_levels: Annotated[float, Gt(0)] = 60.0

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> "SquareSum":
        """The fitness of a mesh in a rig."""
        return SquareSum(synthesizer, [self._term(sensor, mesh, synthesizer) for sensor in rig.sensors.values()])

    def _term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer) -> Term:
        if isinstance(sensor.noise, GaussianColor):
            color = GaussianColor(_deviation(self.color_weight))
            bounds = _bounds(self.color_weight * self.cutoff_levels**2, 3, color.sigma)
            return ColorTerm(sensor.name, synthesizer, mesh.colors, color, bounds)
        depth = GaussianPolynomial(sigma=((_deviation(self.depth_weight),),))
        bounds = _bounds(self.depth_weight * self.cutoff_m**2, 1, depth.sigma[0][0])
        return DepthTerm(sensor.name, synthesizer, len(mesh.vertices), depth, bounds)


class SquareSum(TermSum):
    """The weighted squares of all sensors."""

    def fits(self, surface: Surface) -> list[SensorFit]:
        """How every sensor agrees; its residuals over weights chosen by hand say nothing about its noise."""
        return [replace(fit, normalized_residual=float("nan")) for fit in super().fits(surface)]


def _deviation(weight: float) -> float:
    return float(1 / np.sqrt(2 * weight))


def _bounds(cutoff: float, channels: int, sigma: float) -> Bounds:
    """Bounds that cancel the normaliser of the density, so that costs are the weighted squares alone."""
    normalizer = channels * (np.log(sigma) + LOG_SQRT_2PI)
    return Bounds(-normalizer, cutoff + normalizer, cutoff)

"""Euclidean fitness, the baseline of the likelihood: squared differences with hand-tuned weights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt

from abs_service.tracker.measurements import measurement
from abs_service.tracker.measurements.base import Comparison
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import ModelError, Surface
from abs_service.tracker.objectives.base import TermSum
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import Bounds, ObservedTerm, Term
from abs_service.tracker.terms.sensor_fit import SensorFit
from calib.no_return import NEVER
from calib.noise.base import LOG_SQRT_2PI, DepthNoise
from calib.noise.constant import Constant
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.binary import LightBarrier
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from calib.rig import Rig, Sensor


@dataclass(frozen=True)
class Settings:
    """TOML keys of the Euclidean fitness: every pixel of every sensor counts alike, whatever its noise.

    A weighted square is the likelihood of one constant deviation, 1/√(2 weight), without a mean offset; so the same
    terms serve, and the sensors' own noise models are ignored.

    Attributes:
        depth_weight: cost of a squared metre between measured and synthesised distance.
        color_weight: cost of a squared level between measured and synthesised colour, grey or Bayer channel.
        cutoff_m: difference of distances above which the cost grows no more [m]; vertices without a measurement cost
            as much.
        cutoff_levels: difference of colours above which the cost grows no more, in levels of 256.
        intensity_weight: cost of a squared unit of the stream between measured and synthesised intensity.
        cutoff_intensity: difference of intensities above which the cost grows no more, in units of the stream.
        barrier_weight: cost of a light barrier whose reading contradicts the mesh.
    """

    depth_weight: Annotated[float, Gt(0)] = 5000.0
    color_weight: Annotated[float, Gt(0)] = 0.002
    cutoff_m: Annotated[float, Gt(0)] = 0.03
    cutoff_levels: Annotated[float, Gt(0)] = 60.0
    intensity_weight: Annotated[float, Gt(0)] = 5e-7
    cutoff_intensity: Annotated[float, Gt(0)] = 4000.0
    barrier_weight: Annotated[float, Gt(0)] = 5.0

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> TermSum:
        """The fitness of a mesh in a rig.

        Raises:
            ModelError: a sensor measures something without a weight.
        """
        terms = [self._term(sensor, mesh, synthesizer) for sensor in rig.sensors.values()]
        return TermSum(synthesizer, terms, WeightFeedback())

    def _term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer) -> Term:
        level, cutoff = _deviation(self.color_weight), self.color_weight * self.cutoff_levels**2
        match sensor.noise:
            case DepthNoise():
                sigma = _deviation(self.depth_weight)
                noise, bounds = Constant(sigma), _bounds(self.depth_weight * self.cutoff_m**2, 1, sigma)
            case GaussianColor():
                noise, bounds = GaussianColor(level), _bounds(cutoff, 3, level)
            case GaussianGrey() | GaussianBayer():
                noise, bounds = replace(sensor.noise, sigma=level), _bounds(cutoff, 1, level)
            case GaussianIntensity():
                sigma = _deviation(self.intensity_weight)
                noise = replace(sensor.noise, sigma=sigma, relative=0.0)
                bounds = _bounds(self.intensity_weight * self.cutoff_intensity**2, 1, sigma)
            case LightBarrier():
                wrong = 1 / (1 + np.exp(self.barrier_weight))  # its log-odds are the weight
                noise = LightBarrier(sensor.noise.length_m, wrong, wrong)
                bounds = Bounds(np.log1p(-wrong), self.barrier_weight, self.barrier_weight)
            case _:
                raise ModelError(
                    f'objective = "euclidean" has no weight for sensor "{sensor.name}"; "likelihood" needs none'
                )
        return measurement(noise).term(sensor, mesh, synthesizer, Comparison(bounds))


class WeightFeedback:
    """Feedback to weights, which are no noise model that measurements could contradict."""

    def fits(self, terms: Sequence[ObservedTerm], surface: Surface) -> list[SensorFit]:
        """The agreement without normalised residuals."""
        return [replace(term.fit(surface), normalized_residual=float("nan")) for term in terms]

    def learn(self, terms: Sequence[ObservedTerm], surface: Surface) -> None:
        """Learns nothing."""


def _deviation(weight: float) -> float:
    return float(1 / np.sqrt(2 * weight))


def _bounds(cutoff: float, channels: int, sigma: float) -> Bounds:
    """Bounds that cancel the normaliser of the density, so that costs are the weighted squares alone."""
    normalizer = channels * (np.log(sigma) + LOG_SQRT_2PI)
    return Bounds(-normalizer, cutoff + normalizer, cutoff, NEVER)

"""The negative log-likelihood of all measurements under the sensors' own noise models (eqs. 16–22); no weights."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.objectives.base import TermSum
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import Bounds, Term
from abs_service.tracker.terms.color import ColorTerm
from abs_service.tracker.terms.depth import DepthTerm
from calib.noise.color import LEVELS, GaussianColor
from calib.rig import Rig, Sensor


@dataclass(frozen=True)
class Settings:
    """TOML keys of the likelihood; a sensor's own `outlier_share` and `range_m` go before them.

    Attributes:
        outlier_share: share ε of measurements that come from anywhere (mixed pixels, occluders, what the model cannot
            represent); it bounds what a single measurement can say against a deformation. The density is the larger of
            (1 − ε) times the noise model's and ε times the uniform one, at most log 2 from their sum.
        range_m: distances that a depth sensor can report at all; a measurement that says nothing about the surface is
            uniform over it.
    """

    outlier_share: Annotated[float, Interval(gt=0, lt=1)] = 0.05
    range_m: Annotated[float, Gt(0)] = 5.0

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> TermSum:
        """The likelihood of a mesh in a rig."""
        return TermSum(synthesizer, [self._term(sensor, mesh, synthesizer) for sensor in rig.sensors.values()])

    def _term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer) -> Term:
        if isinstance(sensor.noise, GaussianColor):
            return ColorTerm(sensor.name, synthesizer, mesh.colors, sensor.noise, self.bounds(sensor))
        return DepthTerm(sensor.name, synthesizer, len(mesh.vertices), sensor.noise, self.bounds(sensor))

    def bounds(self, sensor: Sensor) -> Bounds:
        """What a measurement costs that the sensor's noise does not explain."""
        share = sensor.outlier_share or self.outlier_share
        color = isinstance(sensor.noise, GaussianColor)
        uniform = 3 * np.log(LEVELS) if color else np.log(sensor.range_m or self.range_m)
        return Bounds(-np.log1p(-share), uniform, uniform - np.log(share))

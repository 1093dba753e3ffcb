"""The negative log-likelihood of all measurements under the sensors' own noise models (eqs. 16–22); no weights."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval

from abs_service.tracker.measurements import measurement
from abs_service.tracker.measurements.base import Comparison
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.objectives.base import TermSum
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import Bounds, Term
from abs_service.tracker.terms.photometric.texture_registration_noise import TextureRegistrationNoise
from calib.noise.base import DepthNoise
from calib.rig import Rig, Sensor

#: Deviation of an outline in a depth image: it is known to a pixel, and its pixels mix object and background [px].
OUTLINE_PX = 0.5

#: The largest deviation of one that is seen to be ragged [px].
RAGGED_OUTLINE_PX = 3.0


@dataclass(frozen=True)
class Settings:
    """TOML keys of the likelihood; a sensor's own `outlier_share` and `range_m` go before them.

    Attributes:
        outlier_share: share ε of outliers (mixed pixels, occluders, deviations from the model); it bounds the cost of a
            single measurement. The density is the larger of (1 − ε) times the noise model's and ε times the uniform
            one, at most log 2 from their sum. A sensor's own `outlier_share` goes before it.
        range_m: measuring range of a depth sensor [m]; outliers are uniform over it. A sensor's own `range_m` goes
            before it.
        texture_registration_px: texture registration noise: standard deviation of the position of the appearance on the
            mesh, in pixels of the sensor. It widens the noise model around edges of a print. About 0.2 for sharp edges,
            such as those of a checkerboard.
        outline_px: standard deviation of the outline at the free edges of the object, in pixels of the depth sensor;
            it stops a surface from sliding along itself. "auto" is half a pixel, and up to 3 for an outline that
            wanders from image to image, as that of a stereo camera; 0 disables the outline. Edges in contact with
            another surface, cut by a mask or the image's border, and silhouettes of bodies are found in the first image
            and have no outline.
    """

    outlier_share: Annotated[float, Interval(gt=0, lt=1)] = 0.05
    range_m: Annotated[float, Gt(0)] = 5.0
    texture_registration_px: Annotated[float, Ge(0)] = 0.0
    outline_px: Literal["auto"] | Annotated[float, Interval(ge=0, le=3)] = "auto"

    @property
    def derived(self) -> Mapping[str, tuple[float, ...]]:
        """Standard deviation of the outline in use [px], by its key."""
        return {"outline_px": (OUTLINE_PX if self.outline_px == "auto" else self.outline_px,)}

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> TermSum:
        """The likelihood of a mesh in a rig."""
        registration_noise = TextureRegistrationNoise(self.texture_registration_px)
        outline_px = self.derived["outline_px"][0]
        ragged_px = RAGGED_OUTLINE_PX if self.outline_px == "auto" else outline_px
        terms: list[Term] = []
        for sensor in rig.sensors.values():
            comparison = Comparison(self.bounds(sensor), registration_noise, outline_px, ragged_px)
            terms.append(measurement(sensor.noise).term(sensor, mesh, synthesizer, comparison))
        return TermSum(synthesizer, terms)

    def bounds(self, sensor: Sensor) -> Bounds:
        """Costs of the sensor's outlier model."""
        share = sensor.outlier_share or self.outlier_share
        range_m = sensor.range_m or self.range_m
        uniform = float(np.log(range_m)) if isinstance(sensor.noise, DepthNoise) else sensor.noise.uniform
        return Bounds(-np.log1p(-share), uniform, uniform - np.log(share), sensor.no_return)

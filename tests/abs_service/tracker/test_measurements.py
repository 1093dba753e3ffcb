"""Kinds of measurement: every noise model has one, and what has none is refused."""

from dataclasses import dataclass

import numpy as np
import pytest

from abs_service.tracker.measurements import bayer, binary, color, depth, grey, intensity, measurement
from abs_service.tracker.models.base import ModelError
from abs_service.tracker.objectives import euclidean
from calib.noise.base import NoiseError
from calib.noise.constant import Constant
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.binary import LightBarrier
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from calib.noise.measured import Measured
from calib.noise.tof_amplitude import Settings as TofAmplitude
from calib.rig import Rig, Sensor
from drivers.contract.frame import Kind
from tests.abs_service.tracker.scenes import CAMERA, flat, sheet, sparse


@dataclass(frozen=True)
class Weight:
    """Noise of a unit that nobody declared."""

    uniform: float = 1.0

    def deviation(self, values: np.ndarray) -> np.ndarray:
        return np.ones_like(values)


@pytest.mark.parametrize(
    ("noise", "kind", "frames"),
    [
        (Constant(0.01), depth, (Kind.DEPTH,)),
        (TofAmplitude((0.002,), 9.0), depth, (Kind.DEPTH, Kind.AMPLITUDE)),
        (Measured(), depth, (Kind.DEPTH, Kind.DEVIATION)),
        (GaussianColor(), color, (Kind.COLOR,)),
        (GaussianGrey(), grey, (Kind.COLOR,)),
        (GaussianBayer(), bayer, (Kind.BAYER,)),
        (GaussianIntensity("ir", 5.0), intensity, (Kind.IR,)),
        (LightBarrier(0.8), binary, (Kind.BINARY,)),
    ],
)
def test_the_type_of_the_noise_model_names_the_kind(noise, kind, frames):
    found = measurement(noise)
    assert isinstance(found, kind.Measurement)
    assert found.frames == frames


def test_a_noise_model_of_no_kind_is_refused():
    with pytest.raises(NoiseError, match=r"test_measurements\.Weight is the noise of no kind of measurement"):
        measurement(Weight())


def test_the_euclidean_fitness_refuses_a_unit_that_it_has_no_weight_for():
    mesh, rig = sheet(height=flat), Rig("r", {"scales": Sensor("scales", CAMERA, Weight())})
    with pytest.raises(ModelError, match=r'"euclidean" has no weight for sensor "scales"'):
        euclidean.Settings().build(rig, mesh, sparse(CAMERA, mesh))

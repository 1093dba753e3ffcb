"""Light barriers: one beam, which the object interrupts or leaves free."""

from collections.abc import Mapping
from dataclasses import dataclass

from abs_service.pairing.images import BeamReading
from abs_service.tracker.measurements.base import Comparison, Decoder
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.barrier import BarrierTerm
from calib.noise.images.binary import LightBarrier
from calib.rig import Sensor
from drivers.contract.frame import Frame, Kind

Noise = LightBarrier


@dataclass(frozen=True)
class Measurement:
    """Readings of a light barrier; see `MeasurementKind`."""

    noise: LightBarrier
    frames = (Kind.BINARY,)

    def decoder(self, sensor: Sensor) -> Decoder:
        """Interrupted if any pixel is."""
        return _decode

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> BarrierTerm:
        """Crossing of mesh and beam."""
        return BarrierTerm(sensor.name, sensor.camera, mesh.faces, self.noise, comparison.bounds)


def _decode(frames: Mapping[Kind, Frame]) -> BeamReading:
    return BeamReading(bool(frames[Kind.BINARY].si().max() > 0.5))

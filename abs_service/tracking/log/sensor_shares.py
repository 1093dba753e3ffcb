"""Shares of a mesh by what one sensor shows of it, for displays and scripts."""

import math
from dataclasses import dataclass

from absmsg.v1.deformation_state_pb2 import DeformationState


@dataclass(frozen=True, slots=True)
class SensorShares:
    """Shares 0…1 of the vertices that face a sensor; None where unknown.

    Attributes:
        agreeing: measured, and explained by noise.
        disagreeing: measured, but not explained.
        no_return: over missing returns.
        occluder: behind something in front of the object.
        self_occluded: behind the object itself.
        outside: outside the image.
        unexplained: measured surface of the object beyond the mesh, of this surface and the mesh.
        unexplained_at_first: the same in the mesh's first frame.
    """

    agreeing: float | None
    disagreeing: float | None
    no_return: float | None
    occluder: float | None
    self_occluded: float | None
    outside: float | None
    unexplained: float | None
    unexplained_at_first: float | None

    @classmethod
    def of(cls, sensor: DeformationState.Sensor) -> "SensorShares":
        """The shares in a message, rounded to what its single precision holds for sure."""
        shares = (
            sensor.agreeing_share,
            sensor.disagreeing_share,
            sensor.no_return_share,
            sensor.occluder_share,
            sensor.self_occluded_share,
            sensor.outside_share,
            sensor.unexplained_share,
            sensor.unexplained_at_first,
        )
        return cls(*(known(round(share, 6)) for share in shares))


def known(value: float | None) -> float | None:
    """The value, None if it is not finite."""
    return value if value is not None and math.isfinite(value) else None

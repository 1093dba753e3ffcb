"""Geometry of the available heads: poses and fields of view."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import LensModel


@dataclass(frozen=True)
class Optics:
    """Geometry of a head: default size [px], focal length per image width, position in the rig [m]."""

    width: int
    height: int
    focal_ratio: float
    position: tuple[float, float, float]

    def camera(self, width: int, height: int, lens: LensModel) -> Camera:
        """Camera of a given size; without distortion the field of view does not depend on the size."""
        focal = self.focal_ratio * width
        T_rs = pose.from_rotation_vector((0, 0, 0), self.position)
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, lens, T_rs)


@dataclass(frozen=True)
class Beam:
    """Geometry of a light barrier: positions of lamp and receiver in the rig [m]."""

    lamp: tuple[float, float, float]
    receiver: tuple[float, float, float]

    @property
    def camera(self) -> Camera:
        """Camera of one pixel at the lamp, oriented towards the receiver."""
        return Camera(1, 1, 1.0, 1.0, 0.0, 0.0, T_rs=pose.look_at(self.lamp, self.receiver))

    @property
    def length_m(self) -> float:
        """Distance from the lamp to the receiver [m]."""
        return math.dist(self.lamp, self.receiver)


#: Imaging heads. The rig's frame is that of `tof`, which has the geometry of a SwissRanger SR4000.
OPTICS: Mapping[str, Optics] = {
    "tof": Optics(176, 144, 220 / 176, (0.0, 0.0, 0.0)),
    "color": Optics(320, 240, 275 / 320, (0.05, 0.0, 0.0)),
    "structured_light": Optics(320, 240, 288 / 320, (-0.06, 0.0, 0.0)),
    "ir": Optics(320, 240, 288 / 320, (-0.06, 0.0, 0.0)),
    "bayer": Optics(320, 240, 275 / 320, (0.05, 0.03, 0.0)),
}

#: The light barriers. The beam crosses the view at 45° to the image planes and passes the right rim of a sheet of
#: 0.30 m at rest with 3.5 mm clearance, so it is sensitive to lateral and to depth motion.
BEAMS: Mapping[str, Beam] = {"barrier": Beam((0.455, 0.0, 0.70), (-0.145, 0.0, 1.30))}

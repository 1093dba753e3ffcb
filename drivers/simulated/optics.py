"""The geometry of the heads there are: where they look from, and how wide."""

from collections.abc import Mapping
from dataclasses import dataclass

from calib import pose
from calib.camera import Camera


@dataclass(frozen=True)
class Optics:
    """Geometry of a head: default size [px], focal length per image width, position in the rig [m]."""

    width: int
    height: int
    focal_ratio: float
    position: tuple[float, float, float]

    def camera(self, width: int, height: int) -> Camera:
        """A camera without lens distortion that sees the same angle in `width` pixels."""
        focal = self.focal_ratio * width
        T_rs = pose.from_rotation_vector((0, 0, 0), self.position)
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, T_rs=T_rs)


#: The heads that make images. The rig's frame is that of `tof`, whose geometry is that of a SwissRanger SR4000.
OPTICS: Mapping[str, Optics] = {
    "tof": Optics(176, 144, 220 / 176, (0.0, 0.0, 0.0)),
    "color": Optics(320, 240, 275 / 320, (0.05, 0.0, 0.0)),
    "structured_light": Optics(320, 240, 288 / 320, (-0.06, 0.0, 0.0)),
    "bayer": Optics(320, 240, 275 / 320, (0.05, 0.03, 0.0)),
}

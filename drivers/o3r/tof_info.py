"""Parser of the chunk TOF_INFO: camera calibration and settings. Source: ifm3d, modules/deserialize (Apache-2.0)."""

import math
import struct
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calib import pose
from calib.camera import Camera, CameraError
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensError
from drivers.o3r.chunks import ChunkError

#: Version, metres and amplitude per digit, normalisation of three amplitudes, pose of the optics in the user's
#: coordinates, then two models with 32 numbers: from pixels to directions and, the one used here, from
#: directions to pixels.
_INFO = struct.Struct("<I2f3f6f I32f I32f")
#: Fields added in versions 3 and 4: times of three exposures [ns], their durations [s], temperature of the light source
#: [°C].
_MORE = struct.Struct("<3Q3ff")
#: Lens models from directions to pixels: Bouguet's for heads with a narrow view, and fisheye. The latter's fifth
#: number is the angle beyond which its polynomial is constant, outside of the image.
_BROWN_CONRADY, _KANNALA_BRANDT = 1, 3


@dataclass(frozen=True, slots=True)
class TofInfo:
    """Calibration and settings of the camera.

    Attributes:
        distance_m: quantisation step of distances [m].
        amplitude: quantisation step of amplitudes, whose roots are quantised.
        extrinsics: position of the optics in the user's coordinates [m], then its angles about x, y and z [rad].
        model: number of the lens model.
        parameters: of the lens model: fx, fy, mx, my, skew, then distortion.
        exposure_s: the longest of the exposures [s], NaN if unknown.
        temperature_c: of the light source [°C], NaN if unknown.
    """

    distance_m: float
    amplitude: float
    extrinsics: tuple[float, ...]
    model: int
    parameters: tuple[float, ...]
    exposure_s: float
    temperature_c: float

    def camera(self, width: int, height: int) -> Camera:
        """Camera for an image size, in the user's coordinates, which are those of the rig.

        ifm's pixel origin is the corner, ours the centre of the first pixel. Its rotation is the one about x times that
        about y times that about z.

        Raises:
            ChunkError: unsupported lens model, or a pose that is not finite.
        """
        fx, fy, mx, my, skew = self.parameters[:5]
        if self.model not in {_BROWN_CONRADY, _KANNALA_BRANDT} or skew != 0:
            raise ChunkError(
                f"TOF_INFO: lens model {self.model} with skew {skew:g} is not supported, only "
                f"{_BROWN_CONRADY} (Bouguet) and {_KANNALA_BRANDT} (fisheye) without skew"
            )
        if not np.all(np.isfinite(self.extrinsics)):
            raise ChunkError(f"TOF_INFO: the pose {self.extrinsics} must be finite")
        try:
            distortion = np.array(self.parameters[5:10])
            lens = Lens(distortion) if self.model == _BROWN_CONRADY else KannalaBrandt(distortion[:4])
            rotation = Rotation.from_euler("XYZ", self.extrinsics[3:]).as_matrix()
            T_rs = pose.from_rotation(rotation, self.extrinsics[:3])
            return Camera(width, height, fx, fy, mx - 0.5, my - 0.5, lens, T_rs)
        except (CameraError, LensError) as error:
            raise ChunkError(f"TOF_INFO: {error}") from error


def parse(content: bytes) -> TofInfo:
    """Parses the chunk's content.

    Raises:
        ChunkError: too few bytes, or nonpositive units.
    """
    if len(content) < _INFO.size:
        raise ChunkError(f"TOF_INFO needs {_INFO.size} bytes, has {len(content)}")
    values = _INFO.unpack_from(content)
    distance_m, amplitude, extrinsics = *values[1:3], values[6:12]
    if not (0 < distance_m < math.inf and 0 < amplitude < math.inf):
        raise ChunkError(f"TOF_INFO: {distance_m} m and {amplitude} per digit must be positive")
    model, *parameters = values[45:]
    exposure_s = temperature_c = math.nan
    if len(content) >= _INFO.size + _MORE.size:
        *exposures, temperature_c = _MORE.unpack_from(content, _INFO.size)[3:]
        exposure_s = max(exposures) if all(0 <= exposure < 1 for exposure in exposures) else math.nan
    return TofInfo(distance_m, amplitude, extrinsics, model, tuple(parameters), exposure_s, temperature_c)

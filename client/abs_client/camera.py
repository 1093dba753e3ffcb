"""Calibrations of a rig's sensors."""

from dataclasses import dataclass

import numpy as np
from absmsg.v1.sensor_model_pb2 import SensorModel
from numpy.typing import NDArray

from abs_client.errors import MalformedError

#: Most coefficients of a lens, those of `brown_conrady`.
COEFFICIENTS = 8


@dataclass(frozen=True)
class Camera:
    """Camera of a sensor: sensor frame x right, y down, z forward; pixel centres at integer coordinates.

    Attributes:
        width, height: of its images [px].
        K: focal lengths and principal point (3, 3) [px].
        lens: coefficients in OpenCV's order.
        lens_model: `brown_conrady` or `fisheye`.
        T_rs: pose (4, 4), maps coordinates in the sensor to coordinates in the rig [m].
        message: as it was published, with the noise model.
    """

    width: int
    height: int
    K: NDArray[np.float64]
    lens: tuple[float, ...]
    lens_model: str
    T_rs: NDArray[np.float64]
    message: SensorModel


def camera(model: SensorModel) -> Camera:
    """The camera in a message.

    Raises:
        MalformedError: its pose is none, or its lens has too many coefficients.
    """
    if len(model.T_rs) != 16 or len(model.lens) > COEFFICIENTS:
        raise MalformedError(
            f"the calibration of sensor {model.sensor!r} has {len(model.T_rs)} numbers of a pose, not 16, "
            f"or more than {COEFFICIENTS} coefficients of a lens: {len(model.lens)}"
        )
    K = np.array([[model.fx, 0.0, model.cx], [0.0, model.fy, model.cy], [0.0, 0.0, 1.0]])
    pose = np.array(model.T_rs).reshape(4, 4)
    return Camera(model.width, model.height, K, tuple(model.lens), model.lens_model or "brown_conrady", pose, model)

"""Decodes cameras from `absmsg.v1.SensorModel`."""

import numpy as np
from absmsg.v1.sensor_model_pb2 import SensorModel

from calib.camera import Camera
from calib.lenses.by_name import lens_of
from calib.lenses.lens import Lens
from drivers.encoding.parsing import CodecError


def decode_camera(model: SensorModel) -> Camera:
    """Camera of a sensor model.

    Raises:
        CodecError: the parameters are invalid.
    """
    try:
        matrix = (model.fx, model.fy, model.cx, model.cy)
        T_rs = np.array(model.T_rs, float).reshape(4, 4)
        lens = lens_of(model.lens_model or Lens.name, model.lens)  # older recordings do not contain it
        return Camera(model.width, model.height, *matrix, lens, T_rs)
    except ValueError as error:
        raise CodecError(f"the model of sensor {model.sensor!r} is no camera: {error}") from error

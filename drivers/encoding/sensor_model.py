"""Cameras out of `absmsg.v1.SensorModel`, in which recordings and the wire tell of them."""

import numpy as np
from absmsg.v1.sensor_model_pb2 import SensorModel

from calib.camera import Camera
from calib.lens import Lens
from calib.lenses import lens_of
from drivers.encoding.codec import CodecError


def decode_camera(model: SensorModel) -> Camera:
    """The camera that a sensor model describes.

    Raises:
        CodecError: its numbers describe none.
    """
    try:
        matrix = (model.fx, model.fy, model.cx, model.cy)
        T_rs = np.array(model.T_rs, float).reshape(4, 4)
        lens = lens_of(model.lens_model or Lens.name, model.lens)  # older recordings do not say
        return Camera(model.width, model.height, *matrix, lens, T_rs)
    except ValueError as error:
        raise CodecError(f"the model of sensor {model.sensor!r} is no camera: {error}") from error

"""Calibration of the cameras: a tracker begins anew with another one, as after a camera was opened in another mode."""

import logging
import threading
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress

from absmsg.v1.sensor_model_pb2 import SensorModel

from calib.camera import Camera
from drivers.encoding.parsing import CodecError
from drivers.encoding.sensor_model import decode_camera

_log = logging.getLogger(__name__)

#: Messages in a row that must say so, one a second: of two processes that publish one sensor, no tracker follows both.
IN_A_ROW = 2


class CalibrationMonitor:
    """Compares published calibrations with the cameras that a tracker was started with.

    Attributes:
        changed: set when a sensor has another camera.
    """

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        self._cameras = cameras
        self._others: Counter[str] = Counter()
        self.changed = threading.Event()

    def take(self, model: SensorModel) -> None:
        """Takes a sensor model; those of other sensors, and those that are no camera, do not matter."""
        if (camera := self._cameras.get(model.sensor)) is None:
            return
        with suppress(CodecError):
            is_other = decode_camera(model) != camera
            self._others[model.sensor] = self._others[model.sensor] + 1 if is_other else 0
            if self._others[model.sensor] == IN_A_ROW:
                _log.warning("%s has another calibration; the object is detected anew", model.sensor)
                self.changed.set()

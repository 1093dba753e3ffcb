"""Exposure of the colour camera, and a warning while it changes what it makes of the light."""

import math
from collections.abc import Callable

from drivers.kinect1.camera import KinectCamera

#: Name of the condition, and its remedy.
CONDITION = "automatic colours"
_REMEDY = (
    "the first image's colours hold no longer when they change; switch them off in the rig file: "
    "controls = { auto_exposure = false, auto_white_balance = false, exposure_s = 0.02 }"
)


class ColorSettings:
    """Settings of the colour camera as they were read last.

    Args:
        camera: the camera.
        warn: see `drivers.contract.device.Sink.on_warning`.
    """

    def __init__(self, camera: KinectCamera, warn: Callable[[str, str], None]) -> None:
        self._camera = camera
        self._warn = warn
        self._exposure_s = math.nan

    def exposure_s(self) -> float:
        """Exposure time [s]; NaN if it is automatic or was never read."""
        return self._exposure_s

    def read(self) -> None:
        """Reads them from the camera, at the start and after a change; raises the camera's `DeviceError`."""
        auto_exposure, auto_white_balance = self._camera.auto_exposure(), self._camera.auto_white_balance()
        self._exposure_s = math.nan if auto_exposure else self._camera.exposure_s()
        on = {"auto_exposure": auto_exposure, "auto_white_balance": auto_white_balance}
        names = " and ".join(name for name, is_on in on.items() if is_on)
        self._warn(CONDITION, f"{names} on: {_REMEDY}" if names else "")

"""Controls of one device that users set while it is captured."""

import logging
from collections.abc import Mapping

from drivers.contract.controls import ControlInfo, Value
from drivers.contract.device import ControlError, Device

_log = logging.getLogger(__name__)


class RequestedControls:
    """Remembers the values that users have asked for, so that they outlast a new opening of the device."""

    def __init__(self) -> None:
        self._values: dict[str, Value] = {}

    def set(self, values: Mapping[str, Value], device: Device) -> dict[ControlInfo, Value]:
        """Sets controls by name, and returns all that the device has, with their values.

        Raises:
            ControlError: an unknown control or an invalid value; those before it are set.
            DeviceError: the device does not answer.
        """
        for name, value in values.items():
            device.controls.set(name, value)
            self._values.pop(name, None)  # the order counts: an exposure time ends the automatic exposure
            self._values[name] = value
        return {info: device.controls.get(info.name) for info in device.controls.infos}

    def renew(self, device: Device) -> None:
        """Sets everything again; what the device does not take any more is only logged.

        Raises:
            DeviceError: the device does not answer.
        """
        for name, value in self._values.items():
            try:
                device.controls.set(name, value)
            except ControlError as error:
                _log.warning("device %s: %s", device.info.uri, error)

"""Camera heads of a processing unit, from its configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drivers.contract.device import DeviceError, DeviceInfo
from drivers.contract.discovery import Availability, Found


@dataclass(frozen=True, slots=True)
class Head:
    """A time-of-flight head.

    Attributes:
        port: name of the port of the unit that it is plugged into.
        pcic_port: TCP port of its images.
        serial: its serial number.
        model: product name.
        state: `RUN` while it takes images.
        mode: measuring mode, such as `standard_range2m`.
        rate_hz: images per second.
    """

    port: str
    pcic_port: int
    serial: str
    model: str
    state: str
    mode: str
    rate_hz: float

    def found(self, unit: str, firmware: str) -> Found:
        """Identity of the head, and what keeps it from being used.

        Args:
            unit: address of the processing unit, with its TCP port unless that is the default.
            firmware: version of the processing unit's firmware.
        """
        uri = f"o3r://{unit}?head={self.serial}"
        info = DeviceInfo(uri, self.model, self.serial, firmware, f"Ethernet, {self.port} of {unit}")
        if self.state == "RUN":
            return Found(info)
        remedy = "ifm's Vision Assistant sets it to RUN"
        return Found(info, Availability.FAULTY, f"{self.port} is in state {self.state}, not RUN", remedy)


def heads(configuration: Mapping[str, Any]) -> list[Head]:
    """All time-of-flight heads in the JSON of a processing unit.

    Raises:
        DeviceError: a port without what is needed to open it; names the key.
    """
    return [_head(name, port) for name, port in configuration.get("ports", {}).items() if _is_3d(port)]


def _is_3d(port: Mapping[str, Any]) -> bool:
    return port.get("info", {}).get("features", {}).get("type") == "3D"


def _head(name: str, port: Mapping[str, Any]) -> Head:
    try:
        info = port["info"]
        return Head(
            port=name,
            pcic_port=int(port["data"]["pcicTCPPort"]),
            serial=str(info["serialNumber"]),
            model=f"ifm {info.get('deviceName') or info['partNumber']}",
            state=str(port["state"]),
            mode=str(port["mode"]),
            rate_hz=float(port["acquisition"]["framerate"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise DeviceError(f"{name}: its configuration is not understood: {error!r}") from error

"""The devices of a rig by its configuration: their controls, and cameras and noise models of their sensors."""

from collections.abc import Mapping

from abs_service import config
from abs_service.capture.metadata_publisher import ConfiguredSensors
from abs_service.config import addresses, plugins
from abs_service.config.errors import error_of
from calib.camera import Camera
from drivers.contract.controls import Value
from drivers.contract.device import ControlError, Device


class HeadError(Exception):
    """A configuration that names a head which its device does not have."""


class SettingError(Exception):
    """A configuration that sets a control which its device lacks, or to a value out of its range."""


def check_addresses(rig: config.ServiceConfig, source: str) -> None:
    """Refuses a rig in which addresses are wrong, with all of them.

    Raises:
        ConfigError: names the devices.
    """
    problems = list(addresses.check({name: device.uri for name, device in rig.devices.items()}))
    if problems:
        raise error_of(source, problems, "")


def set_controls(device: Device, controls: Mapping[str, Value], where: str) -> None:
    """Sets controls of an opened device.

    Args:
        device: the device.
        controls: values by name.
        where: file and table that they stand in, for messages.

    Raises:
        SettingError: an unknown control or an invalid value; names file, key, value and the allowed values.
        DeviceError: the device does not answer.
    """
    for name, value in controls.items():
        try:
            device.controls.set(name, value)
        except ControlError as error:
            raise SettingError(f"{where}.{error}") from None


def cameras(rig: config.ServiceConfig, name: str, device: Device) -> dict[str, Camera]:
    """Cameras of a device's sensors by sensor name: the device's own, overridden by the rig file.

    Raises:
        HeadError: the configuration names a head that the device does not have.
    """
    found = {}
    for head, sensor in rig.heads(name).items():
        if head not in device.cameras:
            there_are = ", ".join(sorted(device.cameras))
            raise HeadError(f'sensors.{sensor}: device "{name}" has no head "{head}"; it has: {there_are}')
        found[sensor] = rig.sensors[sensor].camera.applied_to(device.cameras[head])
    return found


def configured_sensors(rig: config.ServiceConfig) -> ConfiguredSensors:
    """The configuration itself, and the noise models of its sensors with their outliers."""
    noises = {}
    for sensor, table in rig.sensors.items():
        outliers = table.model_dump(include={"outlier_share", "range_m"}, exclude_none=True)
        noises[sensor] = {} if table.noise is None else plugins.table(table.noise) | outliers
    return ConfiguredSensors(config.to_toml(rig), noises)

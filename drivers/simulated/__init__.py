"""Simulated device: analytic surfaces that bend and move, seen by time-of-flight, structured-light and colour heads.

Independent of the tracker's models: image generation and estimation share no code.
"""

from collections.abc import Callable

from drivers.contract.device import Device
from drivers.contract.discovery import Found
from drivers.simulated.address import parse
from drivers.simulated.device import SimulatedDevice

check_address = parse


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens an address such as `simulated://sheet?seed=1&sensors=tof,color`; the keys are the fields of `Address`.

    Raises:
        AddressError: invalid address; names key, value and the allowed values.
    """
    address = parse(uri)
    return SimulatedDevice(uri, address.build(), clock, fault_schedule=address.fault)


def discover(timeout_s: float) -> list[Found]:
    """Empty: simulated devices are not discovered."""
    return []

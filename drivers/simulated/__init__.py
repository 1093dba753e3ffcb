"""A simulated device: analytic surfaces that bend and move, seen by time-of-flight, structured-light and colour heads.

Nothing here knows the tracker's models: what makes the images shares no code with what explains them.
"""

from collections.abc import Callable

from drivers.contract.device import Device
from drivers.contract.discovery import Found
from drivers.simulated.address import parse
from drivers.simulated.device import SimulatedDevice


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens an address such as `simulated://sheet?seed=1&sensors=tof,color`; its keys are the fields of `Address`.

    Raises:
        AddressError: the address is not understood; names key, value and what is allowed.
    """
    address = parse(uri)
    return SimulatedDevice(uri, address.build(), clock, fault_schedule=address.fault)


def discover(timeout_s: float) -> list[Found]:
    """Nothing: a simulated device is never attached, and always there."""
    return []

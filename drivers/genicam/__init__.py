"""3D cameras by GenICam and GenTL (GigE Vision, USB3 Vision), through harvesters and their maker's producer."""

from drivers.genicam.address import parse
from drivers.genicam.opening import discover, open_device

__all__ = ["check_address", "discover", "open_device"]

check_address = parse

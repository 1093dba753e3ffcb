"""A rig whose frames arrive over the network, from another `abs-service capture`, as a device of this one.

Protocol: `probe`, `device`. Transport: `link`, whose SDK is zenoh. Codec: that of the wire, `drivers.encoding.codec`.
"""

from collections.abc import Callable

from drivers.contract.device import Device, DeviceError, DeviceInfo
from drivers.contract.discovery import Found
from drivers.remote.address import DEFAULT_PORT, Address, parse
from drivers.remote.device import RemoteDevice
from drivers.remote.link import open_link
from drivers.remote.probe import choose_rig, probe


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `remote://HOST:PORT/RIG`; the rig may be left out where there is only one, and all of it on this host.

    Keys: `protocol`, tcp, tls, quic, udp or ws, tcp if not given; `shared_memory`, 0 or 1, 1 if not given: whether
    images of a rig on this host travel through it; `learn`, time to see which streams come [s], 1 if not given;
    `sensors`, which of the rig's are wanted, all if not given.

    Raises:
        AddressError: the address is not understood.
        DeviceError: nothing answers there, there is no such rig, or it delivers nothing.
    """
    address = parse(uri)
    link = open_link(address)
    try:
        rig = choose_rig(link, address)
        return RemoteDevice(address.uri(rig), rig, link, probe(link, rig, address), clock)
    except BaseException:
        link.close()
        raise


def discover(timeout_s: float) -> list[Found]:
    """The rigs that are captured on this host. Others have to be named: zenoh is told not to search the network."""
    try:
        link = open_link(Address("127.0.0.1", DEFAULT_PORT), timeout_s)
    except DeviceError:
        return []
    try:
        rigs = link.rigs(timeout_s)
    finally:
        link.close()
    at = f"tcp 127.0.0.1:{DEFAULT_PORT}"
    return [Found(DeviceInfo(Address().uri(rig), "abs-service rig", rig, link=at)) for rig in rigs]

"""Driver for a rig that another `abs-service capture` publishes, on this host or over the network.

Protocol: `probe`, `device`. Transport: `link`, whose SDK is zenoh. Codec: that of the wire, `drivers.encoding.codec`.
"""

from collections.abc import Callable

from drivers.contract.device import Device, DeviceError, DeviceInfo
from drivers.contract.discovery import Found
from drivers.remote.address import DEFAULT_PORT, Address, parse
from drivers.remote.device import RemoteDevice
from drivers.remote.link import open_link
from drivers.remote.probe import choose_rig, probe

check_address = parse


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `remote://HOST:PORT/RIG`; the rig is optional if there is only one, host and port default to this host.

    Keys: `protocol`, tcp, tls, quic, udp or ws, tcp if not given; `shared_memory`, 0 or 1, 1 if not given: shared
        memory
    transport for images on one host; `learn`, time in which streams are observed before opening [s], 1 if not given;
    `sensors`, comma-separated names, all sensors if not given.

    Raises:
        AddressError: invalid address.
        DeviceError: no answer, no such rig, or no frames.
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
    """Rigs captured on this host. Others must be addressed explicitly: zenoh scouting is disabled."""
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

"""Addresses and configurations of heads; needs no ifm3dpy."""

import sys

import pytest

from drivers.contract import errors
from drivers.contract.device import AddressError, DeviceError, SdkMissingError
from drivers.contract.discovery import Availability
from drivers.o3r import check_address, discover, open_device
from drivers.o3r.address import Address, parse
from drivers.o3r.heads import heads

PORT = {
    "acquisition": {"framerate": 10},
    "data": {"pcicTCPPort": 50012},
    "info": {"partNumber": "M04239", "features": {"type": "3D"}, "serialNumber": "281"},
    "mode": "standard_range4m",
    "state": "RUN",
}


@pytest.mark.parametrize(
    ("uri", "address"),
    [
        ("o3r://", Address()),
        ("o3r://192.168.0.70:81?head=281", Address("192.168.0.70", 81, "281")),
    ],
)
def test_an_address_names_unit_and_head(uri: str, address: Address) -> None:
    assert parse(uri) == address


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("o3r://unit.local", "'unit.local' must be an IPv4 address, such as 192.168.0.69"),
        ("o3r://192.168.0.69:http", "must be an IPv4 address"),
        ("o3r://192.168.0.69/port0", "an IPv4 address is all that may stand before"),
        ("o3r://192.168.0.69?port=0", "unknown key 'port'; allowed are head"),
    ],
)
def test_a_wrong_address_is_refused_with_what_is_allowed(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        check_address(uri)


def test_heads_are_the_3d_ports() -> None:
    (head,) = heads({"ports": {"port2": PORT, "port3": {"info": {"features": {"type": "2D"}}}, "port6": {}}})
    assert (head.port, head.pcic_port, head.rate_hz, head.mode) == ("port2", 50012, 10.0, "standard_range4m")
    found = head.found("192.168.0.69", "1.4.30")
    assert found.info.uri == "o3r://192.168.0.69?head=281"
    assert found.info.model == "ifm M04239"
    assert found.availability == Availability.READY


def test_a_port_that_lacks_something_is_named() -> None:
    with pytest.raises(DeviceError, match="port2: its configuration is not understood: KeyError\\('mode'\\)"):
        heads({"ports": {"port2": {key: value for key, value in PORT.items() if key != "mode"}}})


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ifm3dpy", None)
    monkeypatch.setattr(errors, "PYTHON", (3, 11))
    with pytest.raises(SdkMissingError, match=r"pip install -e '\.\[ifm\]'"):
        open_device("o3r://", lambda: 0)
    (found,) = discover(0.1)
    assert (found.availability, found.remedy) == (Availability.SDK_MISSING, ".venv/bin/pip install -e '.[ifm]'")

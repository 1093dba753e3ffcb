"""Obstacles between a client and a router are told: TLS on one side only, and certificates of another lab."""

import pytest
from abs_client import Rig, Tls, UnreachableError

from abs_service import cli
from abs_service.bus.session import SessionMode
from tests.conftest import encrypted


def certificates(folder, name="viewer", key=None):
    return Tls(folder / "authority.pem", folder / f"{name}.pem", folder / f"{key or name}.key")


@pytest.fixture
def other_lab(tmp_path):
    folder = tmp_path / "keys"
    assert cli.main(["keys", str(folder), "--host", "localhost"]) == 0
    return folder


def test_a_router_with_tls_is_told_from_one_that_is_not_there(secured, endpoint):
    secured("rig", SessionMode.ROUTER)
    for address in (endpoint, encrypted(endpoint)):
        with pytest.raises(UnreachableError, match=rf"{address}: TLS is spoken there: give an endpoint tls/… and the"):
            Rig(address)


def test_a_router_without_tls_is_told(open_bus, keys, endpoint):
    open_bus()
    with pytest.raises(UnreachableError, match=r"^tls/.*: no TLS is spoken there, or it hangs$"):
        Rig(encrypted(endpoint), tls=certificates(keys))


def test_certificates_of_another_lab_are_told_by_who_refuses_them(secured, endpoint, keys, other_lab):
    secured("rig", SessionMode.ROUTER)
    with pytest.raises(UnreachableError, match="its certificate is refused here: "):
        Rig(encrypted(endpoint), tls=certificates(other_lab))
    stolen = Tls(keys / "authority.pem", other_lab / "viewer.pem", other_lab / "viewer.key")
    with pytest.raises(UnreachableError, match="it refuses this certificate: "):
        Rig(encrypted(endpoint), tls=stolen)


def test_a_key_of_another_certificate_is_told(secured, endpoint, keys):
    secured("rig", SessionMode.ROUTER)
    with pytest.raises(UnreachableError, match="the key does not belong to the certificate"):
        Rig(encrypted(endpoint), tls=certificates(keys, key="operator"))

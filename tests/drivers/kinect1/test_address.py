"""Addresses of the Kinect v1."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.device import AddressError
from drivers.kinect1.address import Address, parse
from drivers.kinect1.camera import Stream


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("kinect1://?streams=depth,colour", "some of depth, color and ir"),
        ("kinect1://?streams=color,ir", "only one of the two"),
        ("kinect1://?streams=depth,depth", "each once"),
        ("kinect1://?streams=", "some of"),
        ("kinect1://?rate=30", "unknown key 'rate'"),
        ("kinect1://?streams=ir&streams=depth", "twice"),
        ("kinect1://A/b", "all that may stand before"),
    ],
)
def test_invalid_addresses_name_what_is_allowed(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        parse(uri)


@given(st.text("abdehlmoprst:/?&=,%[]@0\n é", max_size=30))
def test_arbitrary_text_is_an_address_or_an_address_error(rest: str) -> None:
    try:
        address = parse(f"kinect1://{rest}")
    except AddressError:
        return
    assert address.streams


def test_valid_addresses() -> None:
    assert parse("kinect1://") == Address("", (Stream.DEPTH, Stream.COLOR))
    assert parse("kinect1://A00363A0?streams=ir,depth") == Address("A00363A0", (Stream.IR, Stream.DEPTH))

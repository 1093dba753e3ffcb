"""The Orbbec driver without Orbbec's SDK: addresses, its absence, pixels."""

import contextlib
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract import errors
from drivers.contract.device import AddressError, SdkMissingError
from drivers.contract.discovery import Availability
from drivers.contract.frame import Kind
from drivers.orbbec import check_address, discover, open_device
from drivers.orbbec.address import Mode, parse
from drivers.orbbec.picture import Picture, pixels
from drivers.orbbec.streams import StreamError


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("orbbec://?speed=2", "unknown key 'speed'; allowed are color, confidence, depth, ir, recording"),
        ("orbbec://?depth=big", r"depth = 'big' must be 0 \(none\), 1 .* or a width and a height"),
        ("orbbec://?color=640x480@", "color = '640x480@' must be"),
        ("orbbec://1/2", "all that may stand before"),
    ],
)
def test_an_invalid_address_is_a_final_error(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        check_address(uri)


def test_an_address_names_a_serial_number_a_host_or_a_recording() -> None:
    assert parse("orbbec://CL8FC3100XX").serial == "CL8FC3100XX"
    network = parse("orbbec://192.168.1.10?depth=640x576@15&ir=0&confidence=1")
    assert (network.serial, network.host, network.ir) == ("", "192.168.1.10", None)
    assert (network.depth, network.color, network.confidence) == (Mode(640, 576, 15), Mode(), Mode())
    assert parse("orbbec://?recording=take.bag").recording == Path("take.bag")


def test_without_the_sdk_the_driver_says_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", None)
    monkeypatch.setattr(errors, "PYTHON", (3, 11))
    (found,) = discover(0.1)
    assert (found.availability, found.remedy) == (
        Availability.SDK_MISSING,
        ".venv/bin/pip install --no-deps pyorbbecsdk2",
    )
    with pytest.raises(SdkMissingError, match=r"pyorbbecsdk2 is not installed:  .* --no-deps pyorbbecsdk2"):
        open_device("orbbec://", time.monotonic_ns)


@given(
    st.sampled_from(["Y16", "Z16", "Y8", "RGB", "BGR", "MJPG", ""]), st.integers(-2, 20), st.integers(-2, 20),
    st.binary(max_size=600), st.sampled_from([Kind.DEPTH, Kind.IR, Kind.CONFIDENCE, Kind.COLOR]),
)  # fmt: skip
def test_arbitrary_bytes_are_an_image_or_rejected(name: str, width: int, height: int, data: bytes, kind: Kind) -> None:
    picture = Picture(name, width, height, np.frombuffer(data, np.uint8), 0, 0, 0.001, 0.0)
    with contextlib.suppress(StreamError):
        assert pixels(picture, kind)[1].shape[:2] == (height, width)

"""The committee's simulated producer through the real harvesters, addresses, and the message without a producer."""

import time

import numpy as np
import pytest

from drivers.contract.device import AddressError, DeviceError
from drivers.contract.frame import Kind
from drivers.genicam import library, opening
from drivers.genicam.address import parse
from drivers.genicam.device import _Run
from tests.drivers.conformance.bench import streaming
from tests.drivers.conformance.benches.genicam import QUERY, viky


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("genicam://1/2", "a serial number is all"),
        ("genicam://?components=Intensity", "must contain Range"),
        ("genicam://?focal=0", "focal = '0' must be a number of pixels"),
        ("genicam://?size=1", "allowed are components, focal, format"),
    ],
)
def test_an_address_that_no_camera_can_have_is_refused(uri: str, message: str) -> None:
    with pytest.raises(AddressError, match=message):
        parse(uri)


def test_without_a_producer_the_variable_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    viky()
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    with pytest.raises(DeviceError, match="GENICAM_GENTL64_PATH names no folder with a GenTL producer"):
        opening.open_device("genicam://", time.monotonic_ns)


def test_the_ball_of_a_simulated_camera_has_a_height_where_it_has_a_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(library.VARIABLE, viky())
    assert {found.info.uri for found in opening.discover(1.0)} >= {"genicam://0", "genicam://1"}
    device = opening.open_device(f"genicam://0{QUERY}", time.monotonic_ns)
    assert device.info.uri == f"genicam://0{QUERY}"
    assert [one.info.serial for one in opening.discover(1.0) if one.availability != "ready"] == ["0"]
    with streaming(device) as sink:
        assert sink.receives(6)
    images = {frame.key: frame for frame in sink.frames if frame.seq == sink.frames[0].seq}
    depth, color = images["depth", "depth"], images["depth", "color"]
    is_ball = np.any(color.data != 255, axis=2)  # on a white ground, whose height is 0
    assert is_ball.sum() == 20**2
    assert np.array_equal(np.isfinite(depth.si()), is_ball)
    heights_m = [np.nanmax(frame.si()) for frame in sink.frames if frame.kind == Kind.DEPTH]
    assert 0.03 < heights_m[0] < 0.1
    assert len(set(heights_m)) == len(heights_m)  # it bounces, and later images have not overwritten earlier ones


def test_numbers_of_16_bits_begin_anew_without_a_gap() -> None:
    run = _Run()
    assert [run.count(number) for number in (65533, 65534, 1, 3)] == [0, 0, 1, 1]
    assert run.seq == 6

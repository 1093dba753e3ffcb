"""The committee's simulated producer through the real harvesters, addresses, and the message without a producer."""

import itertools
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager

import numpy as np
import pytest

from drivers.contract.device import AddressError, DeviceError, DeviceInfo
from drivers.contract.errors import translated_sdk_errors
from drivers.contract.frame import Kind, Reference
from drivers.genicam import library, opening
from drivers.genicam.address import parse
from drivers.genicam.link import Part, Shot
from tests.drivers.conformance.bench import streaming
from tests.drivers.conformance.benches.genicam import QUERY, viky
from tests.drivers.genicam.node_map import BLAZE, node_map


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("genicam://1/2", "a serial number is all"),
        ("genicam://?components=Intensity", "must be names of components .* one of them Range"),
        ("genicam://?focal=0", "focal = '0' must be a number from 1 to 100000"),
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


class Stamped:
    """A link to a camera that stamps, and whose images with these numbers are composed here."""

    uri = "genicam://1"

    def __init__(self, numbers: Iterator[int]) -> None:
        self.nodes = node_map(BLAZE)
        self._numbers = numbers
        self._taken = 0

    def translated_errors(self) -> AbstractContextManager[None]:
        return translated_sdk_errors(self.uri, "")

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...

    def take(self) -> Shot:
        self._taken += 1
        part = Part("Coord3D_C16", 4, 3, memoryview(np.full((3, 4), self._taken, np.uint16).tobytes()))
        return Shot(next(self._numbers), self.now_ns(), (part,))

    def now_ns(self) -> int:
        return self._taken * 33_000_000


def test_stamps_of_the_camera_are_mapped_and_its_exposure_is_told() -> None:
    numbers = itertools.compress(itertools.count(1), itertools.cycle((1, 0, 1)))  # every third one gets lost
    link = Stamped(numbers)
    info = DeviceInfo(link.uri, "model", "1")
    delay_ns = 5_000_000_000
    device = opening.of_link(link, info, parse(link.uri), lambda: link.now_ns() + delay_ns)  # pyright: ignore[reportArgumentType]
    assert device.capabilities.streams[0].clock.tick_hz == 1e9
    assert device.cameras["depth"].fx == 510
    with streaming(device) as sink:
        assert sink.receives(4)
    for frame in sink.frames:
        assert frame.t_host_ns == pytest.approx(frame.t_device_ticks + delay_ns, abs=10e6)
        assert (frame.t_reference, frame.exposure_s) == (Reference.START, pytest.approx(1e-3))
        expected_m = 0.25e-3 * (frame.t_device_ticks // 33_000_000)
        assert frame.si() == pytest.approx(expected_m, rel=1e-6) or expected_m == 7 * 0.25e-3  # 7 is no measurement
    assert device.counters["missing"] > 0
    assert "clock.depth/depth.drift_ppm" in device.gauges


def test_numbers_of_16_bits_begin_anew_without_a_gap() -> None:
    opened_with, *run = 65530, 65533, 65534, 1, 3  # 0 is no number
    link = Stamped(itertools.chain([opened_with], run, itertools.count(4)))
    info = DeviceInfo(link.uri, "model", "1")
    device = opening.of_link(link, info, parse(link.uri), link.now_ns)  # pyright: ignore[reportArgumentType]
    streams = len(device.capabilities.streams)
    with streaming(device) as sink:
        assert sink.receives(5 * streams)
    assert [frame.seq for frame in sink.frames if frame.kind == Kind.DEPTH][:5] == [1, 2, 4, 6, 7]
    assert device.counters["missing"] == 2 * streams

"""The address selects one mode of every stream."""

from types import SimpleNamespace

import pytest

from drivers.contract.device import DeviceError, SdkMissingError
from drivers.realsense import library
from drivers.realsense.address import parse
from drivers.realsense.profiles import Stream, cameras, wanted
from drivers.realsense.streams import ROLES, StreamError
from tests.drivers.realsense.software_camera import SoftwareCamera

try:
    library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


def offer(kind: str, size: tuple[int, int], fps: int, encoding: str) -> Stream:
    profile = SimpleNamespace(
        width=lambda: size[0], height=lambda: size[1], fps=lambda: fps, format=lambda: SimpleNamespace(name=encoding)
    )
    return Stream(ROLES[kind, 0], profile, encoding)


def test_the_address_selects_one_profile_per_stream() -> None:
    offers = [offer("depth", (640, 480), fps, "z16") for fps in (30, 60)]
    offers += [offer("color", (640, 480), 30, name) for name in ("y16", "bgr8", "rgb8")]
    offers += [offer("infrared", (640, 480), 30, "y8")]
    assert wanted(offers, parse("realsense://")) == [offers[0], offers[4], offers[5]]
    assert wanted(offers, parse("realsense://?fps=60&color=0&ir=0")) == [offers[1]]
    with pytest.raises(DeviceError, match="depth/ir has no 640x480 at 60; it has: 640x480 at 30"):
        wanted(offers, parse("realsense://?fps=60&color=0"))
    with pytest.raises(DeviceError, match="depth/depth has no 1280x720 at 30; it has: 640x480 at 30, 640x480 at 60"):
        wanted(offers, parse("realsense://?depth=1280x720"))


def test_every_stream_may_have_a_size_and_a_rate_of_its_own() -> None:
    offers = [offer("depth", (1280, 720), 30, "z16"), offer("infrared", (640, 480), 60, "y8")]
    offers += [offer("color", (1920, 1080), 15, "rgb8"), offer("confidence", (320, 240), 30, "raw8")]
    keys = "depth=1280x720&color=1920x1080@15&ir=640x480@60"
    assert wanted(offers, parse(f"realsense://?{keys}&confidence=320x240")) == offers
    assert wanted(offers, parse(f"realsense://?{keys}&confidence=0")) == offers[:3]
    with pytest.raises(DeviceError, match="depth/confidence has no 1280x720 at 30; it has: 320x240 at 30"):
        wanted(offers, parse(f"realsense://?{keys}"))


def test_streams_behind_one_lens_have_one_size() -> None:
    depth, other = SoftwareCamera().profiles["depth"], offer("infrared", (32, 24), 30, "y8")
    with pytest.raises(StreamError, match="depth/ir has 32x24 pixels and the others of its head 64x48"):
        cameras([Stream(ROLES["depth", 0], depth, "16UC1"), other])

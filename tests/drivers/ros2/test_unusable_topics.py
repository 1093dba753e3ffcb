"""Topics of a bag of ROS 2 that cannot be used are told by name, or used as far as they go."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.ros2.bag import Ros2Bag
from tests.drivers.ros2.take import STAMP_NS, Take

DEPTH = np.arange(48, dtype=np.uint16).reshape(6, 8)
COLOR = np.random.default_rng(2).integers(256, size=(6, 8, 3), dtype=np.uint8)
D, C = "/camera/depth", "/camera/color"


def not_calibrated(take: Take) -> None:
    take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)


def no_depth(take: Take) -> None:
    take.info(f"{C}/camera_info")
    take.image(f"{C}/image_raw", "one", "rgb8", COLOR)
    take.info(f"{D}/camera_info")
    take.image(f"{D}/image_raw", "one", "yuv422", DEPTH)


def not_connected(take: Take) -> None:
    take.info(f"{D}/camera_info")
    take.info(f"{C}/camera_info")
    take.image(f"{D}/image_raw", "depth_optical", "16UC1", DEPTH)
    take.image(f"{C}/image_raw", "color_optical", "rgb8", COLOR)


def unknown_lens(take: Take) -> None:
    take.info(f"{D}/camera_info", "omni")
    take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)


def no_focal_length(take: Take) -> None:
    take.info(f"{D}/camera_info", focal=0.0)
    take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)


def other_size(take: Take) -> None:
    take.info(f"{D}/camera_info")
    take.image(f"{D}/image_raw", "one", "16UC1", DEPTH[:4])


def infra_red(take: Take) -> None:
    take.info(f"{D}/camera_info")
    take.image(f"{D}/image_raw", "one", "mono16", DEPTH)


def test_colours_that_are_left_out_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with Take(tmp_path / "take") as take:
        take.info(f"{D}/camera_info")
        take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)
        take.image(f"{C}/image_raw", "one", "rgb8", COLOR)
    assert set(Ros2Bag(tmp_path / "take").cameras) == {"depth"}
    assert caplog.messages == [f"{tmp_path / 'take'}: left out: {C}/image_raw: there is no {C}/camera_info"]


def test_images_without_stamps_have_the_times_of_their_recording(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = tmp_path / "take"
    with Take(store) as take:
        take.info(f"{D}/camera_info")
        for k in range(2):
            image = {"height": 6, "width": 8, "encoding": "16UC1", "is_bigendian": 0, "step": 16}
            data = DEPTH.view(np.uint8).ravel()
            message = take.make("sensor_msgs/msg/Image", header=take.header("one", 0), data=data, **image)
            take.put(f"{D}/image_raw", message, STAMP_NS + k * 33_000_000)
    assert [frame.t_host_ns - STAMP_NS for frame in Ros2Bag(store).frames()] == [0, 33_000_000]
    assert caplog.messages == [f"{store}: {D}/image_raw has no time stamps: all are taken from when it was recorded"]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (not_calibrated, "/camera/depth/image_raw: there is no /camera/depth/camera_info"),
        (no_depth, "/camera/depth/image_raw: the encoding 'yuv422' is none of"),
        (not_connected, "/tf_static does not say where 'color_optical' is relative to 'depth_optical'"),
        (unknown_lens, "the lens 'omni' with 5 coefficients"),
        (no_focal_length, "the camera is not calibrated: fx = 0.0: must be positive and finite"),
        (other_size, "depth of 8 × 4 pixels is not what its camera takes, 8 × 6"),
        (infra_red, "/camera/depth/image_raw has images of kind ir, not 16UC1 or 32FC1"),
    ],
)
def test_what_cannot_be_used_is_told(tmp_path: Path, content: Callable[[Take], None], complaint: str) -> None:
    with Take(tmp_path / "take") as take:
        content(take)
    with pytest.raises(ForeignRecordingError, match=complaint):
        list(Ros2Bag(tmp_path / "take").frames())

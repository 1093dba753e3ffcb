"""The driver on unmodified libusb, which sees emulated cameras through umockdev."""

import sys

import pytest

from evaluation.service.kinect1_emulation import testbed
from tests.drivers.kinect1.scenarios import STORIES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(testbed.why_not()), reason=testbed.why_not() or "never"),
]


@pytest.mark.parametrize("story", STORIES)
def test_on_unmodified_libusb(story: str) -> None:
    cameras = 2 if story == "two" else 1
    done = testbed.run([sys.executable, "-m", "tests.drivers.kinect1.scenarios", story], cameras=cameras)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr

"""A software camera for the tests of opening and of devices."""

from collections.abc import Iterator

import pytest

from tests.drivers.realsense.software_camera import SoftwareCamera


@pytest.fixture
def camera() -> Iterator[SoftwareCamera]:
    software = SoftwareCamera()
    yield software
    software.halt()

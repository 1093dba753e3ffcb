"""What every test may ask for: repeatable property tests, a real device, and the data sets kept beside the checkout."""

import os
from pathlib import Path

import hypothesis
import pytest

# The same examples on every machine and in every run; the first one may have to wait for a kernel to compile.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", metavar="URI", help="run the hardware tests on this device, for example oak://")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--device") is not None:
        return
    without_device = pytest.mark.skip(reason="needs a real device: --device URI")
    for item in items:
        if item.get_closest_marker("hardware") is not None:
            item.add_marker(without_device)


@pytest.fixture(scope="session")
def device_uri(request: pytest.FixtureRequest) -> str:
    """The device that the hardware tests run on."""
    return str(request.config.getoption("--device"))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recorded data sets: too large for the repository, so a test that needs one skips without it."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ABS_SHARED_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no data sets in {folder}; name their folder with ABS_SHARED_DATA")
    return folder

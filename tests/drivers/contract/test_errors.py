"""A library that is missing, and one that cannot be loaded, are told apart."""

import pytest

from drivers.contract.errors import SdkMissingError


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (None, "sdk is not installed:  .venv/bin/pip install -e '.[extra]'"),
        (ModuleNotFoundError("No module named 'sdk'"), "sdk is not installed:  .venv/bin/pip install -e '.[extra]'"),
        (
            ImportError("libx.so.1: no such file"),
            "sdk cannot be loaded: libx.so.1: no such file:  install what it lacks",
        ),
    ],
)
def test_what_stands_in_the_way_of_a_library_is_said(error, message):
    assert str(SdkMissingError("sdk", "extra", error=error)).startswith(message)

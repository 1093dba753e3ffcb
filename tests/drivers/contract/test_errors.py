"""A library that is missing, and one that cannot be loaded, are told apart."""

import pytest

from drivers.contract import errors
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


def test_what_installs_a_library_names_the_environment_that_runs(monkeypatch):
    monkeypatch.setattr("sys.prefix", "/opt/abs-service")
    assert errors.install_extra("view") == "/opt/abs-service/bin/pip install '.[view]'"
    assert SdkMissingError("sdk", options="--no-deps").remedy == "/opt/abs-service/bin/pip install --no-deps sdk"


@pytest.mark.parametrize(("running", "is_reported"), [((3, 13), False), ((3, 14), True)])
def test_a_library_without_a_wheel_for_this_python_asks_for_another(running, is_reported, monkeypatch):
    monkeypatch.setattr(errors, "PYTHON", running)
    message = str(SdkMissingError("sdk", "extra", newest_python=(3, 13)))
    assert (
        "sdk is not installed, and has no wheel for Python 3.14:  make clean all PYTHON=python3.13" in message
    ) == is_reported


def test_an_error_of_a_library_without_a_message_is_named():
    with (
        pytest.raises(errors.DeviceError, match=r"^camera://1: TimeoutError\(\)$"),
        errors.translated_sdk_errors("camera://1", ""),
    ):
        raise TimeoutError

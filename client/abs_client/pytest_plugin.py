"""The fixture `abs_rig`: a simulated rig that tracks, one for each module of tests.

@pytest.mark.abs_rig(seed=3, fault="stall@90")   # or pytestmark = …; --abs-rig seed=3 for all of them
def test_x(abs_rig): ...
"""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import pytest

from abs_client.simulated_rig import RunningRig, SimulatedRig, run_rig

_TYPES = {"seed": int, "rate": float, "speed": float}
_FIELDS = {one.name for one in fields(SimulatedRig)} - {"keys"}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the rig."""
    group = parser.getgroup("abs_rig", "simulated rig of abs-service")
    group.addoption(
        "--abs-rig",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="setting of the simulated rig, any number of times: seed, rate, speed, fault, or a key of the simulator",
    )
    group.addoption(
        "--abs-service",
        default="",
        metavar="COMMAND",
        help="command that starts abs-service; {folder} in it is that of the rig's file (default: the installed one)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """The mark."""
    config.addinivalue_line("markers", "abs_rig(**settings): settings of the simulated rig that abs_rig starts")


@pytest.fixture(scope="module")
def abs_rig(request: pytest.FixtureRequest) -> Iterator[RunningRig]:
    """A simulated rig that tracks, with the settings of `pytestmark = pytest.mark.abs_rig(…)` and of --abs-rig."""
    options: list[str] = request.config.getoption("--abs-rig") or []
    given = {"service": request.config.getoption("--abs-service"), **dict(map(_pair, options))}
    mark = request.node.get_closest_marker("abs_rig")
    with run_rig(settings_of(given | (dict(mark.kwargs) if mark else {}))) as rig:
        yield rig


def settings_of(given: dict[str, Any]) -> SimulatedRig:
    """Settings from keys of `SimulatedRig` and of the simulator's address.

    Raises:
        pytest.UsageError: a value is no number where one is needed.
    """
    own = {key: value for key, value in given.items() if key in _FIELDS}
    try:
        own = {key: _TYPES.get(key, str)(value) for key, value in own.items()}
    except ValueError:
        raise pytest.UsageError(f"--abs-rig: seed, rate and speed are numbers, not {own}") from None
    return SimulatedRig(**own, keys={key: str(value) for key, value in given.items() if key not in _FIELDS})


def _pair(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals:
        raise pytest.UsageError(f"--abs-rig {text}: write KEY=VALUE, such as seed=3")
    return key, value

"""Validation of control values; errors name the allowed values."""

import math

import pytest

from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.errors import ControlError

INFOS = [
    ControlInfo("exposure_s", ControlKind.NUMBER, "s", 1e-5, 0.033),
    ControlInfo("gain", ControlKind.WHOLE, "", 1, 50),
    ControlInfo("auto_exposure", ControlKind.SWITCH),
    ControlInfo("modulation", ControlKind.CHOICE, choices=("low", "high")),
]


@pytest.fixture
def device() -> tuple[Controls, dict[str, Value]]:
    """Controls, and the values written to their device."""
    held: dict[str, Value] = {}

    def control(info: ControlInfo) -> Control:
        return Control(info, lambda: held[info.name], lambda value: held.update({info.name: value}))

    return Controls(control(info) for info in INFOS), held


@pytest.mark.parametrize(
    ("name", "value", "held"),
    [("exposure_s", 0.01, 0.01), ("exposure_s", 1e-5, 1e-5), ("gain", 50, 50), ("auto_exposure", False, False)],
)
def test_allowed_values_are_written_to_the_device(device, name: str, value: Value, held: Value) -> None:
    controls, reached = device
    controls.set(name, value)
    assert reached == {name: held}
    assert controls.get(name) == held


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("exposure_s", 1, r"exposure_s = 1: must be a number from 1e-05 to 0\.033 s$"),
        ("exposure_s", math.nan, "exposure_s = NaN: must be"),
        ("exposure_s", "0.01", 'exposure_s = "0.01": must be'),
        ("exposure_s", True, "exposure_s = true: must be"),
        ("gain", 1.5, r"gain = 1\.5: must be a whole number from 1 to 50$"),
        ("gain", True, "gain = true: must be"),
        ("gain", 51, "gain = 51: must be"),
        ("auto_exposure", 1, "auto_exposure = 1: must be true or false"),
        ("modulation", "middle", 'modulation = "middle": must be one of low, high'),
        ("modulation", 1, "modulation = 1: must be one of"),
        ("gian", 3, "gian: the device has no such control, it has: auto_exposure, exposure_s, gain, modulation"),
    ],
)
def test_invalid_values_raise_and_are_not_written(device, name: str, value, complaint: str) -> None:
    controls, reached = device
    with pytest.raises(ControlError, match=complaint):
        controls.set(name, value)
    assert reached == {}


def test_a_device_without_controls_raises() -> None:
    with pytest.raises(ControlError, match="gain: the device has no such control, it has none"):
        Controls().get("gain")

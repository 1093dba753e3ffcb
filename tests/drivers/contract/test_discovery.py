"""Discovery with failing drivers, and selection of a device by its address."""

import sys
import threading
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from drivers import opening
from drivers.contract.device import AddressError, DeviceError, DeviceInfo
from drivers.contract.discovery import Availability, Found, choose

ONE, OTHER = (Found(DeviceInfo(f"oak://{serial}", "OAK-D", serial)) for serial in ("111", "222"))
BUSY = Found(DeviceInfo("oak://333", "OAK-D", "333"), Availability.BUSY, "another program has it", "close that program")


def test_an_address_without_a_serial_number_selects_the_only_device() -> None:
    assert choose([ONE], "oak", "") is ONE
    assert choose([ONE, OTHER], "oak", "222") is OTHER


@pytest.mark.parametrize(
    ("found", "serial", "complaint"),
    [
        ([], "", "^no oak device is attached$"),
        ([ONE], "9", "^oak://9 is not attached; attached: oak://111$"),
        ([], "9", "^oak://9 is not attached; attached: none$"),
        ([ONE, OTHER], "", "^2 oak devices are attached; say which one: oak://111, oak://222$"),
        ([BUSY], "", "^oak://333: another program has it; close that program$"),
    ],
)
def test_an_address_without_a_match_raises_with_the_reason(found: list[Found], serial: str, complaint: str) -> None:
    with pytest.raises(DeviceError, match=complaint):
        choose(found, "oak", serial)


def test_a_failing_or_hanging_driver_does_not_hide_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    ending = threading.Event()

    def breaks(timeout_s: float) -> list[Found]:
        raise OSError("no bus")

    def hangs(timeout_s: float) -> list[Found]:
        ending.wait(30)
        return []

    searches = {"breaks": breaks, "hangs": hangs, "works": lambda timeout_s: [ONE]}
    for name, discover in searches.items():
        module = ModuleType(f"external_{name}")
        module.discover = discover  # pyright: ignore[reportAttributeAccessIssue]
        monkeypatch.setitem(sys.modules, module.__name__, module)
    points = [EntryPoint(name, f"external_{name}", "drivers") for name in searches]
    monkeypatch.setattr(opening, "entry_points", lambda group: points)
    monkeypatch.setattr(opening, "available", lambda: list(searches))
    broken, hanging, working = opening.discover(0.2, grace_s=0.0)
    ending.set()
    assert (broken.availability, hanging.availability) == (Availability.FAULTY, Availability.FAULTY)
    assert "OSError('no bus')" in broken.reason
    assert hanging.reason == "the driver has not answered for 0.2 s"
    assert hanging.remedy == "on a slow or busy machine: --timeout 30"
    assert working is ONE


def test_every_driver_has_a_discovery() -> None:
    assert all(callable(sys.modules[f"drivers.{scheme}"].discover) for scheme in opening.available())
    assert all(callable(sys.modules[f"drivers.{scheme}"].check_address) for scheme in opening.available())


def test_a_driver_that_cannot_be_imported_is_named_and_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "entry_points", lambda group: [EntryPoint("absent", "no_such_driver", "drivers")])
    (broken,) = [found for found in opening.discover(5.0) if found.info.model == "absent"]
    assert broken.availability is Availability.FAULTY
    assert "No module named 'no_such_driver'" in broken.reason
    with pytest.raises(AddressError, match=r"^absent://1: its driver no_such_driver cannot be imported"):
        opening.check_address("absent://1")
    with pytest.raises(AddressError, match=r"scheme 'nonsense' is none of .*'absent'"):
        opening.check_address("nonsense://1")


def test_an_address_that_is_none_is_refused_before_its_driver_is_asked() -> None:
    with pytest.raises(AddressError, match=r"^oak://\[: Invalid IPv6 URL$"):
        opening.check_address("oak://[")

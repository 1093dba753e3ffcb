"""An Orbbec camera's properties as controls, with the types of Orbbec's SDK."""

import weakref
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.contract.capabilities import SyncRole
from drivers.contract.device import ControlError, DeviceError, SdkMissingError
from drivers.orbbec import library
from drivers.orbbec.controls import make, sync_modes

try:
    ob = library.load()
except SdkMissingError as error:
    pytest.skip(str(error), allow_module_level=True)


class Session:
    """An open camera as the SDK's methods show it, with some of a Femto Bolt's properties."""

    def __init__(self) -> None:
        names = ob.OBPropertyID.__members__
        self.values = {names["OB_PROP_COLOR_EXPOSURE_INT"]: 100, names["OB_PROP_COLOR_AUTO_EXPOSURE_BOOL"]: True}
        self.config = ob.OBMultiDeviceSyncConfig()
        self.config.mode = ob.OBMultiDeviceSyncMode.STANDALONE

    def is_property_supported(self, key: Any, permission: Any) -> bool:
        return key in self.values

    def get_int_property_range(self, key: Any) -> Any:
        return SimpleNamespace(min=1, max=301, step=3)

    def get_int_property(self, key: Any) -> int:
        return self.values[key]

    def set_int_property(self, key: Any, value: int) -> None:
        self.values[key] = value

    get_bool_property, set_bool_property = get_int_property, set_int_property

    def get_supported_multi_device_sync_mode_bitmap(self) -> int:
        modes = ob.OBMultiDeviceSyncMode
        return sum(map(int, (modes.FREE_RUN, modes.STANDALONE, modes.PRIMARY, modes.SECONDARY)))

    def get_multi_device_sync_config(self) -> Any:
        return self.config

    def set_multi_device_sync_config(self, config: Any) -> None:
        if config.mode == ob.OBMultiDeviceSyncMode.SECONDARY:
            raise ob.OBError("Device is busy")
        self.config = config


def test_controls_are_the_cameras_properties() -> None:
    session = Session()
    controls = make(ob, "orbbec://1", lambda: session)
    assert [info.name for info in controls.infos] == ["color.auto_exposure", "color.exposure", "sync_role"]
    controls.set("color.exposure", 300)
    assert controls.get("color.exposure") == 301  # a step of the camera
    controls.set("color.auto_exposure", False)
    assert controls.get("color.auto_exposure") is False
    with pytest.raises(ControlError, match="must be a whole number from 1 to 301"):
        controls.set("color.exposure", 302)


def test_controls_do_not_keep_a_closed_camera_open() -> None:
    cameras = [Session()]
    controls = make(ob, "orbbec://1", lambda: cameras[0])
    gone = weakref.ref(cameras[0])
    cameras.clear()
    assert gone() is None
    assert controls.infos


def test_roles_of_synchronisation_are_the_sdks_modes() -> None:
    session = Session()
    controls = make(ob, "orbbec://1", lambda: session)
    assert set(sync_modes(ob, session)) == set(SyncRole)
    assert controls.get("sync_role") == "free"
    controls.set("sync_role", "master")
    assert session.config.mode == ob.OBMultiDeviceSyncMode.PRIMARY
    with pytest.raises(DeviceError, match="orbbec://1: another program uses it"):
        controls.set("sync_role", "slave")
    session.config.mode = ob.OBMultiDeviceSyncMode.SOFTWARE_TRIGGERING
    with pytest.raises(DeviceError, match="SOFTWARE_TRIGGERING, which is none of free, master, slave"):
        controls.get("sync_role")

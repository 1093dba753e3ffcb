"""Commands of the page to its rig."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from abs_service.display.page.acting import controls
from abs_service.display.page.acting.recording import Record
from abs_service.display.page.acting.reinitialization import Send


@dataclass(frozen=True, slots=True)
class Commands:
    """Commands to a rig.

    Attributes:
        reinitialize, record, control: to a tracker, to the recorder, and to a device.
        references: by tracker, the sensor in whose depth image its object is detected.
        devices: names of those that may have controls.
    """

    reinitialize: Send
    record: Record
    control: controls.Send
    references: Mapping[str, str]
    devices: Sequence[str]


#: Where nothing takes a command.
NONE = Commands(lambda tracker, choice: None, lambda recording: None, lambda device, values: None, {}, ())

"""Commands of the page to its rig."""

from collections.abc import Mapping
from dataclasses import dataclass

from abs_service.display.page.recording import Record
from abs_service.display.page.reinitialization import Send


@dataclass(frozen=True, slots=True)
class Commands:
    """Commands to a rig.

    Attributes:
        reinitialize, record: to a tracker, and to the recorder.
        references: by tracker, the sensor in whose depth image its object is detected.
    """

    reinitialize: Send
    record: Record
    references: Mapping[str, str]


#: Where nothing takes a command.
NONE = Commands(lambda tracker, choice: None, lambda recording: None, {})

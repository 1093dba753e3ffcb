"""What a simulated device does wrong on demand, so that whatever depends on devices can be tried on one that fails."""

import re
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from drivers.contract.frame import Frame, Kind


class Fault(StrEnum):
    """A way to misbehave."""

    NONE = "none"
    DROP = "drop"  # every second exposure is lost
    STALL = "stall"  # nothing comes any more, and nobody says so
    UNPLUG = "unplug"  # the device is gone, and says so
    WRONG_SIZE = "wrong_size"  # images lack a row
    NAN = "nan"  # nothing is measured, in any pixel of a depth image


#: How many exposures a fault lasts that passes.
PASSING_FAULT_EXPOSURES = 10


@dataclass(frozen=True)
class FaultSchedule:
    """What goes wrong, and from which exposure on."""

    fault: Fault = Fault.NONE
    begin: int = 0

    def at(self, k: int) -> Fault:
        """What is wrong at exposure `k`."""
        if k < self.begin or (self.fault not in _PERMANENT and k >= self.begin + PASSING_FAULT_EXPOSURES):
            return Fault.NONE
        return Fault.NONE if self.fault == Fault.DROP and (k - self.begin) % 2 else self.fault


_PERMANENT = frozenset({Fault.STALL, Fault.UNPLUG})


def corrupted(frame: Frame, fault: Fault) -> Frame:
    """The frame as a device with a fault of its images delivers it."""
    if fault == Fault.WRONG_SIZE:
        return replace(frame, data=frame.data[:-1])
    if fault == Fault.NAN and frame.kind == Kind.DEPTH:
        nothing = np.nan if frame.invalid is None else frame.invalid
        return replace(frame, data=np.full_like(frame.data, nothing))
    return frame


def read(text: str) -> FaultSchedule:
    """Reads `stall@20`: a fault and the exposure with which it begins.

    Raises:
        ValueError: says what the text must be.
    """
    match = re.fullmatch(r"([a-z_]+)@(\d{1,9})", text)
    faults = sorted(fault.value for fault in Fault if fault != Fault.NONE)
    if match is None or match[1] not in faults:
        raise ValueError(f"FAULT@EXPOSURE, for example stall@20; the faults are {', '.join(faults)}")
    return FaultSchedule(Fault(match[1]), int(match[2]))

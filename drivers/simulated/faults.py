"""Fault injection: a simulated device that fails on demand, for tests of everything that uses devices."""

import re
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from drivers.contract.frame import Frame, Kind


class Fault(StrEnum):
    """Kind of fault."""

    NONE = "none"
    DROP = "drop"  # every second exposure is lost
    STALL = "stall"  # no more frames, without an error
    UNPLUG = "unplug"  # the device reports that it was unplugged
    WRONG_SIZE = "wrong_size"  # images lack one row
    NAN = "nan"  # depth images without a valid pixel
    FREEZE = "freeze"  # the same images again and again, with new time stamps


#: Duration of a temporary fault [exposures].
PASSING_FAULT_EXPOSURES = 10


@dataclass(frozen=True)
class FaultSchedule:
    """A fault and its first exposure."""

    fault: Fault = Fault.NONE
    begin: int = 0

    def at(self, k: int) -> Fault:
        """Fault that is active at exposure `k`."""
        if k < self.begin or (self.fault not in _PERMANENT and k >= self.begin + PASSING_FAULT_EXPOSURES):
            return Fault.NONE
        return Fault.NONE if self.fault == Fault.DROP and (k - self.begin) % 2 else self.fault

    def shown(self, k: int) -> int:
        """The exposure whose images are those of exposure `k`."""
        return self.begin if self.at(k) == Fault.FREEZE else k


_PERMANENT = frozenset({Fault.STALL, Fault.UNPLUG, Fault.FREEZE})


def corrupted(frame: Frame, fault: Fault) -> Frame:
    """The frame, corrupted by a fault that affects images."""
    if fault == Fault.WRONG_SIZE:
        return replace(frame, data=frame.data[:-1])
    if fault == Fault.NAN and frame.kind == Kind.DEPTH:
        nothing = np.nan if frame.invalid is None else frame.invalid
        return replace(frame, data=np.full_like(frame.data, nothing))
    return frame


def read(text: str) -> FaultSchedule:
    """Parses `stall@20`: a fault and its first exposure.

    Raises:
        ValueError: invalid text; names the expected format.
    """
    match = re.fullmatch(r"([a-z_]+)@(\d{1,9})", text)
    faults = sorted(fault.value for fault in Fault if fault != Fault.NONE)
    if match is None or match[1] not in faults:
        raise ValueError(f"FAULT@EXPOSURE, for example stall@20; the faults are {', '.join(faults)}")
    return FaultSchedule(Fault(match[1]), int(match[2]))

"""Faults of cameras: those of the simulated device."""

import math

from evaluation.service.faults.fault import PATIENCE_S, Elsewhere, Fault, Made
from evaluation.service.faults.processes import killed
from evaluation.service.faults.running import RunningRig

#: Exposure of the simulated device with which its fault begins: five seconds after it was opened.
BEGIN = 150
#: Exposures that a passing fault takes.
PASSING = 10


def lasting(rig: RunningRig) -> Made:
    """A fault that lasts until the device is opened again; it comes `BEGIN` exposures after each opening."""
    rig.await_new_frame(lambda seq, _: seq == BEGIN - 1, PATIENCE_S)
    # Not its arrival: on a busy machine, the health that tells the fault may come before the last image.
    stamps = [stamp for _, seq, _, stamp in rig.listener.frames if seq == BEGIN - 1]
    return Made(rig.on_own_clock(stamps[-1:])[0], rig.await_new_frame(lambda seq, _: seq < BEGIN - 1, PATIENCE_S))


def passing(rig: RunningRig) -> Made:
    """A fault of ten exposures; the device is opened again for each."""
    killed("capture", rig)
    begin_ns = rig.await_new_frame(lambda seq, _: seq == BEGIN - 1, PATIENCE_S)
    return Made(begin_ns, rig.await_new_frame(lambda seq, _: seq >= BEGIN + PASSING, PATIENCE_S))


def _lasting(name: str, promise: str, kind: str, maximum_s: float) -> Fault:
    return Fault(name, promise, lasting, estimates_s=maximum_s, recording_s=maximum_s, device=f"&fault={kind}@{BEGIN}")


def _passing(name: str, promise: str, kind: str, recording_s: float) -> Fault:
    restarted = frozenset({"capture"})  # by `passing` itself
    device = f"&fault={kind}@{BEGIN}"
    return Fault(name, promise, passing, 1.5, recording_s, math.inf, restarted=restarted, device=device)


FAULTS = (
    _lasting(
        "frozen camera: one image with new stamps", "no such image is tracked; opened again after 5 s", "freeze", 8.0
    ),
    _lasting("silent camera", "opened again after 5 s", "stall", 8.0),
    _lasting("unplugged camera, plugged in again", "opened again at once", "unplug", 3.0),
    _passing("ten depth images without a measurement", "tracked again within 1 s", "nan", 0.5),
    _passing("ten images of a wrong size", "left out and counted; tracked again within 1 s", "wrong_size", 1.0),
    Elsewhere(
        "a device's clock drifts or jumps",
        "a new epoch; no time runs backwards",
        "tests/drivers/contract/test_clock.py",
    ),
)

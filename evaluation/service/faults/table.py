"""All faults: those of issue and reliability page, and of what recorders that are trusted promise."""

from evaluation.service.faults import cameras, folders, hosts, messages, processes
from evaluation.service.faults.fault import Elsewhere, Fault

#: In the order of the page.
FAULTS: tuple[Fault | Elsewhere, ...] = (
    *processes.FAULTS,
    *folders.FAULTS,
    *cameras.FAULTS,
    *messages.FAULTS,
    *hosts.FAULTS,
    Elsewhere(
        "mistakes in a configuration",
        "exit code 2 with file, key, value and the allowed values",
        "tests/system/test_user_errors.py",
    ),
    Elsewhere(
        "a rig file is half-written when it is read again",
        "no tracker ends; what is wrong changes nothing",
        "tests/abs_service/commands/running/test_settled_file.py",
    ),
    Elsewhere(
        "a process that never works",
        "the others go on; `status` names it; a log of days stays readable",
        "tests/abs_service/supervision/test_repeats.py",
    ),
    Elsewhere(
        "a process is starved of processor time",
        "it is not restarted; health says why",
        "tests/system/faults/test_stops.py",
    ),
)

"""Reaction of the service to faults: every fault, injected repeatedly into real processes.

Files, sockets and clocks are real; the camera is simulated. Where this machine does not permit a
fault, that is said instead of an outcome.

Statistic: of each fault, the tries in which every promise was kept, and the longest times without an estimate that says
TRACKING, without a recorded depth image, until a component's health was not OK, and to recover.
Goals: every promise is kept in every try; the bounds are those of `Fault`, written before the first run.
    Changed on 2026-11-24 after single tries: nothing has to be in health while the router itself is away, since nobody
    could receive it; how soon it tracks after a restart is a bound of its own, which is stricter than before.
    Changed on 2026-11-28 after ten tries in a row: a process works for ten seconds before it is killed again, after
    which the promise holds; the supervisor waits for up to 3 s before it starts again one that fails sooner.
Seeds: none; faults come when the rig is calm, at no fixed phase of its periods.
Easier than reality: one fault at a time, and a rig that may restart its processes as often as it likes.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.experiment import Context, Findings, UnavailableError, at_most
from evaluation.service.faults import report
from evaluation.service.faults.fault import Fault, make_tries
from evaluation.service.faults.report import Row
from evaluation.service.faults.table import FAULTS
from evaluation.service.live.service import ServiceError

TITLE = "Faults: what is promised, lost, said and how soon it is well again"


@dataclass(frozen=True, slots=True)
class Settings:
    """Faults and their number.

    Attributes:
        tries: of each fault.
        only: words, one of which the name of a fault has to contain; "" for all faults.
    """

    tries: int = 10
    only: tuple[str, ...] = ("",)


#: One fault of every kind, which exercises all of the experiment, three times each.
QUICK = Settings(3, ("fork server", "takes no byte", "unplugged", "random bytes", "reboots"))


def run(settings: Settings, context: Context) -> Findings:
    """Makes the faults, one after the other."""
    chosen = [one for one in FAULTS if isinstance(one, Fault) and any(word in one.name for word in settings.only)]
    rows = [_row(fault, settings.tries, context) for fault in chosen]
    return findings(rows)


def findings(rows: Sequence[Row]) -> Findings:
    """Goals, table and values of all faults that were tried."""
    tried = [row for row in rows if row.tries]
    goals = [at_most(f"{row.name}: tries of {row.tries} with a broken promise", row.missed, 0) for row in tried]
    return Findings(tuple(goals), report.sections(rows), {"rows": [row.values() for row in rows]})


def _row(fault: Fault, tries: int, context: Context) -> Row:
    with tempfile.TemporaryDirectory(prefix="abs-faults-") as folder:
        try:
            return report.row(fault, make_tries(fault, tries, Path(folder), context.progress))
        except UnavailableError as error:
            return Row(fault.name, fault.promise, outcome=f"not permitted here: {error}")
        except (ServiceError, TimeoutError) as error:
            return Row(fault.name, fault.promise, tries, tries, f"MISSED: {error}")

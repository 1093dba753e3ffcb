"""Cases that fooled the calibration, before and after, by the commands that a user types.

Statistic: of each case its own, as the table says: exit codes, files that are left, reasons that are named, and ratios.
Goals: those that the table names; ± of parameters are 0.8 to 1.3 times what the parameters scatter by. "Before" was
measured at commit 943c478, on the sets that the cells name where they differ from those here.
Seeds: fixed, in the module of each case; the context's is not used.

Cases on real recordings need the data folder, and are skipped without it. Simulated views are easier than real ones:
their corners are given, so nothing is searched in images, and only what a case is about goes wrong.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from abs_service.report.content import Cell, Column, Section, Table
from evaluation.calibration.calibration_cases import (
    bad_inputs,
    conversion,
    depth,
    deviations,
    duplicates,
    noise,
    other_tools,
    verdicts,
)
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome
from evaluation.experiment import Context, Findings, Goal, UnavailableError, at_least

TITLE = "Calibration: cases that fooled it, before and after"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        draws: of the bootstrap of each real set; 0 leaves it out.
        rigs: simulated rigs whose errors are compared with their ±; 100 tell a ratio to 7 %.
        units_mm: units in which real distances are stored for a noise calibration [mm].
        brief: True to leave out the cases that take longest.
    """

    draws: int = 100
    rigs: int = 100
    units_mm: tuple[float, ...] = (1.0, 0.2, 0.1)
    brief: bool = False


QUICK = Settings(0, 0, (), brief=True)

_COLUMNS = (
    Column("case"), Column("before (943c478)"), Column("now"), Column("goal"), Column("result"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Runs every case again."""
    rows: list[tuple[Cell, ...]] = []
    goals: list[Goal] = []
    for case in (each for each in all_cases(settings) if each.brief or not settings.brief):
        context.progress(case.name)
        try:
            outcome = _measured(case, context.data)
        except UnavailableError as error:
            rows.append((case.name, case.before, f"skipped: {error}", "–", "skipped"))
            continue
        except Exception as error:  # whatever the product does in place of what the case expects
            outcome = Outcome(f"{type(error).__name__}: {error}", (at_least("measured", 0, 1),))
        rows.append((case.name, case.before, outcome.now, _text(outcome.goals), _result(outcome.goals)))
        goals.append(_all_met(case.name, outcome.goals))
    count = sum(row[-1] == "met" for row in rows)
    skipped = sum(row[-1] == "skipped" for row in rows)
    missed = len(rows) - count - skipped
    text = f"{count} of {len(rows)} cases meet all of their goals, {missed} do not, {skipped} are skipped."
    table = Table("Every case, before and after", _COLUMNS, tuple(rows))
    values = {"met": count, "skipped": skipped, "cases": len(rows)}
    return Findings(tuple(goals), (Section("Before and after", (text, table)),), values)


def all_cases(settings: Settings) -> Iterator[Case]:
    """Every case, also those that are left out of the quick form."""
    yield from duplicates.cases()
    yield from noise.cases(settings.units_mm)
    yield from conversion.cases()
    yield from depth.cases()
    yield from deviations.cases(settings.draws, settings.rigs) if settings.rigs else ()
    yield from verdicts.cases()
    yield from other_tools.cases()
    yield from bad_inputs.cases()


def _measured(case: Case, data: Path | None) -> Outcome:
    """The case in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        return case.measure(Bench(Path(folder), None if data is None else data.resolve()))


def _text(goals: tuple[Goal, ...]) -> str:
    return "; ".join(f"{goal.name} {goal.relation} {goal.bound:g}{goal.unit and f' {goal.unit}'}" for goal in goals)


def _result(goals: tuple[Goal, ...]) -> str:
    missed = [f"{goal.name} is {goal.value:.3g}" for goal in goals if not goal.met]
    return f"missed: {', '.join(missed)}" if missed else "met"


def _all_met(name: str, goals: tuple[Goal, ...]) -> Goal:
    """The goals of a case as one; required if a goal that is required is missed."""
    met = sum(goal.met for goal in goals)
    required = any(goal.required and not goal.met for goal in goals)
    reason = " ".join(goal.reason for goal in goals if not goal.met)
    return at_least(f"{name}: goals met", met, len(goals), reason=reason, required=required)

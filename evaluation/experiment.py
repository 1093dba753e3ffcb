"""Interface of an experiment: its context, its goals and its findings.

An experiment is a module, or a package, in one of the groups of `evaluation.running`, with

    TITLE: str                                                  its question on one line: "E1: ten geometries …"
    Settings                                                    frozen dataclass; the defaults are the full experiment
    QUICK: Settings                                             the same in seconds
    def run(settings: Settings, context: Context) -> Findings
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from abs_service.report.content import Level, Report, Section, Verdict, Wording
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit

#: Words for the levels of an evaluation's verdicts.
GOALS = Wording(
    {Level.GOOD: "met", Level.DOUBTFUL: "open", Level.BAD: "missed"},
    {
        Level.GOOD: "All goals are met.",
        Level.DOUBTFUL: "No goal is missed, but not all could be evaluated.",
        Level.BAD: "Not all goals are met.",
    },
)


class UnavailableError(Exception):
    """Data or packages that are not part of the repository are missing; the message says how to get them."""


@dataclass(frozen=True, slots=True)
class Context:
    """Inputs of an experiment besides its settings.

    Attributes:
        seed: of all random numbers: equal seeds and settings give equal findings, except for measured times.
        data: folder with recordings that are not part of the repository; None if there is none.
        progress: called with a few words on the current step.
    """

    seed: int
    data: Path | None = None
    progress: Callable[[str], None] = lambda text: None


@dataclass(frozen=True, slots=True)
class Goal:
    """A statistic and its required bound; created by `at_least` and `at_most`.

    Attributes:
        name: of the statistic, as the beginning of a sentence: "Surface error, Euclidean / likelihood".
        value: of the statistic; NaN if it could not be measured, which misses the goal.
        relation: "≥" or "≤".
        bound: the value to reach.
        unit: of both; "" if none.
        reason: known reason for missing the goal; one sentence.
        required: True if the exit code of the command depends on it.
    """

    name: str
    value: float
    relation: str
    bound: float
    unit: str = ""
    reason: str = ""
    required: bool = False

    @property
    def met(self) -> bool:
        """True if the statistic is within its bound."""
        return self.value >= self.bound if self.relation == "≥" else self.value <= self.bound

    def verdict(self) -> Verdict:
        """The goal as a sentence with its level."""
        unit = f" {self.unit}" if self.unit else ""
        measured = "not measured" if math.isnan(self.value) else f"{self.value:.3g}{unit}"
        text = f"{self.name}: {measured}, goal {self.relation} {self.bound:.3g}{unit}."
        return Verdict(Level.GOOD, text) if self.met else Verdict(Level.BAD, text, self.reason)


def at_least(
    name: str, value: float, bound: float, unit: str = "", reason: str = "", *, required: bool = False
) -> Goal:
    """Goal with a lower bound; arguments as of `Goal`."""
    return Goal(name, float(value), "≥", bound, unit, reason, required)


def at_most(name: str, value: float, bound: float, unit: str = "", reason: str = "", *, required: bool = False) -> Goal:
    """Goal with an upper bound; arguments as of `Goal`."""
    return Goal(name, float(value), "≤", bound, unit, reason, required)


@dataclass(frozen=True)
class Findings:
    """Result of an experiment.

    Attributes:
        goals: the most important first.
        sections: the evidence: text, tables and pictures.
        values: numbers for programs, by name; written to the JSON report unchanged.
    """

    goals: tuple[Goal, ...]
    sections: tuple[Section, ...]
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Goal, ...]:
        """Required goals that are missed."""
        return tuple(goal for goal in self.goals if goal.required and not goal.met)


def report(title: str, findings: Findings, conditions: Mapping[str, Any], provenance: Provenance) -> Report:
    """Findings as a report.

    Args:
        title: of the experiment.
        findings: its result.
        conditions: seed, settings, commit, duration; shown, and added to the values of the JSON report.
        provenance: command, date and version.
    """
    made = Section("How this was made", tuple(f"{name}: {value}" for name, value in conditions.items()))
    goals = [
        {"name": goal.name, "value": goal.value, "relation": goal.relation, "bound": goal.bound, "met": goal.met}
        for goal in findings.goals
    ]
    return Report(
        title=title,
        provenance=provenance,
        verdicts=tuple(goal.verdict() for goal in findings.goals),
        sections=(*findings.sections, made),
        values={**conditions, "goals": goals, **findings.values},
        wording=GOALS,
        exit_code=Exit.FAILED if findings.failed else Exit.OK,
    )

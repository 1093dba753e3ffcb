"""What an experiment is given, what it finds out, and how a figure is judged against its goal."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from abs_service.report.content import Level, Report, Section, Verdict, Wording
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit

#: What the levels of an evaluation's verdicts are called.
GOALS = Wording(
    {Level.GOOD: "met", Level.DOUBTFUL: "open", Level.BAD: "missed"},
    {
        Level.GOOD: "All goals are met.",
        Level.DOUBTFUL: "No goal is missed, but not all could be judged.",
        Level.BAD: "Not all goals are met.",
    },
)


class UnavailableError(Exception):
    """An experiment that lacks something which is not part of the program: data, or packages; says how to get it."""


@dataclass(frozen=True, slots=True)
class Context:
    """What the surroundings give to an experiment.

    Attributes:
        seed: of everything random: equal seeds and settings give equal findings, but for measured times.
        data: folder with recordings that are not part of the repository; None if there is none.
        progress: told in a few words what is being done.
    """

    seed: int
    data: Path | None = None
    progress: Callable[[str], None] = lambda text: None


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure that was measured, and what was wanted; made by `at_least` and `at_most`.

    Attributes:
        what: the figure, in words that begin a sentence: "Surface error, Euclidean / likelihood".
        value: what was measured; NaN if it could not be, which meets no goal.
        bound: "≥" or "≤".
        limit: what was wanted.
        unit: of both; "" if none.
        reason: why it is missed, if it is and that is known; one sentence.
        required: whether the exit code of the command depends on it.
    """

    what: str
    value: float
    bound: str
    limit: float
    unit: str = ""
    reason: str = ""
    required: bool = False

    @property
    def met(self) -> bool:
        """Whether the figure is as wanted."""
        return self.value >= self.limit if self.bound == "≥" else self.value <= self.limit

    def verdict(self) -> Verdict:
        """The goal as a judgement in plain words."""
        unit = f" {self.unit}" if self.unit else ""
        said = "not measured" if math.isnan(self.value) else f"{self.value:.3g}{unit}"
        text = f"{self.what}: {said}, goal {self.bound} {self.limit:.3g}{unit}."
        return Verdict(Level.GOOD, text) if self.met else Verdict(Level.BAD, text, self.reason)


def at_least(
    what: str, value: float, limit: float, unit: str = "", reason: str = "", *, required: bool = False
) -> Goal:
    """A figure that should be at least `limit`; arguments as of `Goal`."""
    return Goal(what, float(value), "≥", limit, unit, reason, required)


def at_most(what: str, value: float, limit: float, unit: str = "", reason: str = "", *, required: bool = False) -> Goal:
    """A figure that should be at most `limit`; arguments as of `Goal`."""
    return Goal(what, float(value), "≤", limit, unit, reason, required)


@dataclass(frozen=True)
class Findings:
    """What an experiment found out.

    Attributes:
        goals: the figures that something was wanted of, the most important first.
        sections: the evidence: text, tables and pictures.
        values: numbers for programs, by name; they go into the JSON form as they are.
    """

    goals: tuple[Goal, ...]
    sections: tuple[Section, ...]
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Goal, ...]:
        """The required goals that are missed."""
        return tuple(goal for goal in self.goals if goal.required and not goal.met)


class Experiment(Protocol):
    """A module of `evaluation.experiments`."""

    TITLE: str
    Settings: Callable[[], Any]
    QUICK: Any

    @staticmethod
    def run(settings: Any, context: Context) -> Findings:
        """Does the experiment.

        Raises:
            UnavailableError: something is missing that is not part of the program.
        """
        ...


def report(title: str, findings: Findings, made: Mapping[str, Any], provenance: Provenance) -> Report:
    """Findings as a report.

    Args:
        title: of the experiment.
        findings: what it found out.
        made: how: seed, settings, commit; shown, and added to the values of the JSON form.
        provenance: where it comes from.
    """
    how = Section("How this was made", tuple(f"{name}: {value}" for name, value in made.items()))
    goals = [
        {"what": goal.what, "value": goal.value, "bound": goal.bound, "limit": goal.limit, "met": goal.met}
        for goal in findings.goals
    ]
    return Report(
        title=title,
        provenance=provenance,
        verdicts=tuple(goal.verdict() for goal in findings.goals),
        sections=(*findings.sections, how),
        values={**made, "goals": goals, **findings.values},
        wording=GOALS,
        exit_code=Exit.FAILED if findings.failed else Exit.OK,
    )

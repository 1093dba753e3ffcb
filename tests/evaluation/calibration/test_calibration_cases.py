"""The table of cases that fooled the calibration: what is missed, skipped or ended by an error is said as such."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from abs_service.report.content import Table
from evaluation.calibration import calibration_cases
from evaluation.calibration.calibration_cases import conversion
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome, Said
from evaluation.experiment import Context, at_least, at_most


def outcome(bench: Bench) -> Outcome:
    return Outcome("0.7 px", (at_least("exit code", 1, 1), at_most("error", 0.7, 0.5, "px", required=True)))


def missing(bench: Bench) -> Outcome:
    return Outcome(str(bench.real("nowhere")), ())


def broken(bench: Bench) -> Outcome:
    return Outcome((bench.folder / "out.toml").read_text(encoding="utf-8"), ())


def test_a_missed_goal_is_a_missed_case_and_missing_data_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def cases(settings: calibration_cases.Settings) -> Iterator[Case]:
        yield Case("1 views twice", "trusted", outcome)
        yield Case("2 real", "trusted", missing)
        yield Case("2 writes nothing", "trusted", broken)
        yield Case("3 long", "trusted", missing, brief=False)

    monkeypatch.setattr(calibration_cases, "all_cases", cases)
    found = calibration_cases.run(calibration_cases.QUICK, Context(0))
    (text, table) = found.sections[0].blocks
    assert isinstance(table, Table)
    first, second, third = table.rows
    assert first[2:] == ("0.7 px", "exit code ≥ 1; error ≤ 0.5 px", "missed: error is 0.7")
    assert second[2:] == ("skipped: needs the data set nowhere", "–", "skipped")
    assert str(third[2]).startswith("FileNotFoundError: ")
    assert third[-1] == "missed: measured is 0"
    assert text == "0 of 3 cases meet all of their goals, 2 do not, 1 are skipped."
    goal = found.goals[0]
    assert (goal.name, goal.value, goal.bound, goal.met) == ("1 views twice: goals met", 1, 2, False)
    assert goal in found.failed


def test_a_case_runs_the_command_of_a_user_and_is_missed_where_that_is_silent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path, None)
    assert all(goal.met for goal in conversion.skew(bench).goals)
    monkeypatch.setattr(Bench, "run", lambda bench, *words: Said(0, "wrote out.toml"))
    (tmp_path / "out.toml").touch()
    assert not any(goal.met for goal in conversion.skew(bench).goals)

"""Outcomes of faults as rows of a table, in the report and in docs/reference/reliability.md."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from abs_service.report.content import Column, Section, Table
from evaluation.service.faults.fault import Fault, Try


@dataclass(frozen=True, slots=True)
class Row:
    """One fault. Times are the longest of all tries [s]; NaN: it did not happen, or was not tried.

    Attributes:
        name, promise: see `Fault`.
        tries: how often it was made.
        missed: tries in which a promise was broken.
        outcome: in words.
        estimates_s, recording_s, noticed_s, recovered_s: see `Try`.
        said: the health that said it, in one of the tries.
    """

    name: str
    promise: str
    tries: int = 0
    missed: int = 0
    outcome: str = ""
    estimates_s: float = math.nan
    recording_s: float = math.nan
    noticed_s: float = math.nan
    recovered_s: float = math.nan
    said: str = ""

    def values(self) -> dict[str, Any]:
        """Values for the JSON report; `from_values` is the inverse."""
        return asdict(self)

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> "Row":
        """A row of a JSON report, in which NaN is null."""
        cells: dict[str, Any] = {name: math.nan if value is None else value for name, value in values.items()}
        return cls(**cells)


def row(fault: Fault, tries: Sequence[Try]) -> Row:
    """The row of a fault: promises kept and longest times over its tries."""
    missed = [words for words in (one.missed(fault) for one in tries) if words]
    most = Counter(words.split(" for ")[0].split(" after ")[0] for words in missed).most_common(1)
    example = max((words for words in missed if most and words.startswith(most[0][0])), default="")
    return Row(
        fault.name,
        fault.promise,
        len(tries),
        len(missed),
        f"MISSED in {len(missed)}: {example}" if missed else "kept",
        _longest(one.estimates_s for one in tries),
        _longest(one.recording_s for one in tries),
        _longest(one.noticed_s for one in tries) if math.isfinite(fault.noticed_s) else math.nan,
        _longest(one.recovered_s for one in tries),
        next((one.said for one in tries if one.said), ""),
    )


def sections(rows: Iterable[Row]) -> tuple[Section, ...]:
    """The table of the report."""
    columns = (
        *(Column(title) for title in ("fault", "promise", "tries", "outcome")),
        *(Column(title, "s", ".2f") for title in ("without estimate", "without recording", "in health", "to recover")),
        Column("first said"),
    )
    table = Table("Longest times of all tries", columns, tuple(_cells(row) for row in rows))
    return (Section("Faults", (table,)),)


def _cells(row: Row) -> tuple[str | float, ...]:
    times = (row.estimates_s, row.recording_s, row.noticed_s, row.recovered_s)
    return (row.name, row.promise, str(row.tries), row.outcome, *times, row.said)


def _longest(values: Iterable[float]) -> float:
    """Largest value; NaN if one of them is."""
    found = list(values)
    return math.nan if any(map(math.isnan, found)) else max(found)

"""Writes the outcomes of faults into docs/reference/reliability.md, from reports of the experiment `faults`.

  python -m evaluation.service.faults.page results/faults/report.json …

Rows of faults that no report has stay as they are.
"""

import json
import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from evaluation.service.faults.fault import Elsewhere, Fault
from evaluation.service.faults.report import Row
from evaluation.service.faults.table import FAULTS

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "reliability.md"
BEGIN, END = "<!-- faults: written by `make faults` -->", "<!-- faults: end -->"
HEAD = (
    "| fault | promise | tries | outcome | no estimate s | no recording s | in health s | to recover s |",
    "|---|---|---|---|---|---|---|---|",
)


def main(reports: Sequence[str]) -> None:
    """Rewrites the part of the page between the markers."""
    rows = [Row.from_values(values) for path in reports for values in _read(path)]
    PAGE.write_text(rewritten(PAGE.read_text(encoding="utf-8"), rows), encoding="utf-8")


def rewritten(page: str, rows: Iterable[Row]) -> str:
    """The page with the table of all faults, in which those of `rows` are new.

    Raises:
        ValueError: the page lacks a marker.
    """
    before, _, rest = page.partition(BEGIN)
    old, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{PAGE.name} needs the lines {BEGIN} and {END}")
    lines = {name(line): line for line in old.splitlines()} | {row.name: _line(row) for row in rows}
    table = (_elsewhere(one) if isinstance(one, Elsewhere) else lines.get(one.name, _not_run(one)) for one in FAULTS)
    return "\n".join([before + BEGIN, *HEAD, *table, END + after])


def name(line: str) -> str:
    """First cell of a line of a table; "" if it is none."""
    return line.split("|")[1].strip() if line.startswith("| ") else ""


def _line(row: Row) -> str:
    times = (row.estimates_s, row.recording_s, row.noticed_s, row.recovered_s)
    cells = (row.name, row.promise, str(row.tries or "–"), row.outcome, *map(_seconds, times))
    return f"| {' | '.join(cells)} |"


def _not_run(fault: Fault) -> str:
    return _line(Row(fault.name, fault.promise, outcome="not run"))


def _elsewhere(fault: Elsewhere) -> str:
    return f"| {fault.name} | {fault.promise} | – | simulated: `{fault.test}` | – | – | – | – |"


def _seconds(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1f}"


def _read(path: str) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = json.loads(Path(path).read_text(encoding="utf-8"))["values"]["rows"]
    return rows


if __name__ == "__main__":
    main(sys.argv[1:])

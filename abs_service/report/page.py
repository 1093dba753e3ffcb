"""A report as one self-contained HTML page, and as JSON with the same numbers."""

import base64
import json
import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from abs_service.report.content import Cell, Column, Level, Picture, Report, Table, to_json
from calib.files import atomic

if TYPE_CHECKING:
    import jinja2

#: Mark beside each level's word, so that the level does not depend on colour.
MARKS = {Level.GOOD: "✓", Level.DOUBTFUL: "!", Level.BAD: "✗"}

#: Both forms of a report say where it comes from.
_SIGN = b'provenance"'


class ReportFileError(Exception):
    """A report that cannot be written."""


def write(report: Report, path: Path) -> tuple[Path, Path]:
    """Writes a report as an HTML page, and as JSON beside it, whose name ends in `.json`; returns both paths.

    Raises:
        ReportFileError: one of them cannot be written.
    """
    page, data = _paths(path)
    try:
        atomic.write(page, to_html(report))
        atomic.write(data, json.dumps(to_json(report), ensure_ascii=False, indent=1) + "\n")
    except OSError as error:
        raise ReportFileError(f"{error.filename}: the report cannot be written: {error.strerror}") from error
    return page, data


def check_replaceable(path: Path) -> None:
    """Checks, before the minutes after which a report is written, that it will replace nothing but an earlier one.

    Args:
        path: as for `write`.

    Raises:
        ReportFileError: a file of its name, which ends in `.html` or `.json`, is something else.
    """
    for old in _paths(path):
        try:
            is_other = _SIGN not in old.read_bytes()
        except FileNotFoundError:
            continue
        except OSError as error:
            raise ReportFileError(f"{old}: the report cannot be written: {error.strerror}") from error
        if is_other:
            raise ReportFileError(f"{old}: exists and is no report, which would replace it; choose another name")


def _paths(path: Path) -> tuple[Path, Path]:
    return path.with_suffix(".html"), path.with_suffix(".json")


def to_html(report: Report) -> str:
    """The report as an HTML page; every text is escaped."""
    return _template().render(report=report, marks=MARKS) + "\n"


@cache
def _template() -> "jinja2.Template":
    import jinja2  # noqa: PLC0415  only commands that write a report load it

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("abs_service.report", ""), autoescape=True, undefined=jinja2.StrictUndefined
    )
    environment.tests |= {
        "table": lambda value: isinstance(value, Table),
        "level": lambda value: isinstance(value, Level),
        "nan": lambda value: isinstance(value, float) and math.isnan(value),
    }
    environment.filters |= {"number": _number, "alignments": _alignments, "data_url": _data_url}
    return environment.get_template("page.html.j2")


def _number(value: str | float, column: Column) -> str:
    """A cell's text: a string unchanged, a number in the format of its column."""
    if isinstance(value, str):
        return value
    return format(value, "" if isinstance(value, int) else column.format).replace("-", "−")


def _alignments(table: Table) -> list[str]:
    """HTML attribute of each column: numbers are aligned to the right."""
    columns = [[row[index] for row in table.rows] for index in range(len(table.columns))]
    return [" class=number" if _is_numeric(cells) else "" for cells in columns]


def _is_numeric(cells: list[Cell]) -> bool:
    return not any(isinstance(cell, str | Level) for cell in cells)


def _data_url(picture: Picture) -> str:
    return f"data:{picture.media_type};base64,{base64.b64encode(picture.content).decode('ascii')}"

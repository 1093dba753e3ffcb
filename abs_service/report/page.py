"""A report as one HTML page that needs no other file, and as JSON."""

import base64
import json
import math
from html import escape
from importlib import resources
from pathlib import Path

from abs_service.report.content import Cell, Column, Level, Picture, Report, Section, Table, Verdict, Wording, to_json
from abs_service.report.provenance import Provenance

#: A mark beside the word, so that nobody depends on seeing its colour.
MARKS = {Level.GOOD: "✓", Level.DOUBTFUL: "!", Level.BAD: "✗"}

# The policy makes browsers refuse whatever would be fetched from elsewhere.
_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<h1>{title}</h1>
<p class="byline">{byline}</p>
</header>
<main>
{main}
</main>
</body>
</html>
"""


class ReportFileError(Exception):
    """A report that cannot be written."""


def write(report: Report, path: Path) -> tuple[Path, Path]:
    """Writes a report as an HTML page, and as JSON beside it.

    Args:
        report: what to write.
        path: of the page; the JSON file's name ends in `.json` instead.

    Returns:
        Both paths.

    Raises:
        ReportFileError: one of them cannot be written.
    """
    page, data = path.with_suffix(".html"), path.with_suffix(".json")
    try:
        page.write_text(to_html(report), encoding="utf-8")
        data.write_text(json.dumps(to_json(report), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ReportFileError(f"{error.filename}: the report cannot be written: {error.strerror}") from error
    return page, data


def to_html(report: Report) -> str:
    """The report as an HTML page."""
    style = resources.files("abs_service.report").joinpath("page.css").read_text(encoding="utf-8")
    parts = [
        _verdicts(report),
        _contents(report.sections),
        *(_section(number, section) for number, section in enumerate(report.sections, start=1)),
        _provenance(report.provenance),
    ]
    where = report.provenance
    return _PAGE.format(
        title=escape(report.title),
        style=style,
        byline=f"{escape(where.date)} · abs-service {escape(where.version)}",
        main="\n".join(part for part in parts if part),
    )


def _verdicts(report: Report) -> str:
    if not report.verdicts:
        return ""
    items = "\n".join(_verdict(verdict, report.wording) for verdict in report.verdicts)
    headline = (
        f'<p class="headline {report.level}">{_mark(report.level)} {escape(report.wording.headlines[report.level])}</p>'
    )
    return f'<section aria-label="Verdict">\n{headline}\n<ul class="verdicts">\n{items}\n</ul>\n</section>'


def _verdict(verdict: Verdict, wording: Wording) -> str:
    about = f"<strong>{escape(verdict.about)}</strong> " if verdict.about else ""
    advice = f'<p class="advice">{escape(verdict.advice)}</p>' if verdict.advice else ""
    word = f'<span class="word">{_mark(verdict.level)} {escape(wording.words[verdict.level])}</span>'
    return f'<li class="{verdict.level}">{word}<div><p>{about}{escape(verdict.text)}</p>{advice}</div></li>'


def _mark(level: Level) -> str:
    return f'<span class="mark" aria-hidden="true">{MARKS[level]}</span>'


def _contents(sections: tuple[Section, ...]) -> str:
    if len(sections) < 3:
        return ""
    links = " · ".join(f'<a href="#s{number}">{escape(one.title)}</a>' for number, one in enumerate(sections, start=1))
    return f'<nav aria-label="Contents">{links}</nav>'


def _section(number: int, section: Section) -> str:
    blocks = "\n".join(map(_block, section.blocks))
    return f'<section id="s{number}">\n<h2>{escape(section.title)}</h2>\n{blocks}\n</section>'


def _block(block: str | Table | Picture) -> str:
    if isinstance(block, str):
        return f"<p>{escape(block)}</p>"
    return _table(block) if isinstance(block, Table) else _picture(block)


def _picture(picture: Picture) -> str:
    source = f"data:{picture.media_type};base64,{base64.b64encode(picture.content).decode('ascii')}"
    return (
        f'<figure><img src="{source}" alt="{escape(picture.alt)}">'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    aligned = [" class=number" if _is_numeric(cells) else "" for cells in _by_column(table)]
    head = "".join(f'<th scope="col"{how}>{_heading(column)}</th>' for column, how in zip(table.columns, aligned))
    rows = "\n".join(f"<tr>{_row(table.columns, aligned, row)}</tr>" for row in table.rows)
    # A wide table scrolls by itself, with the keyboard too, instead of the whole page.
    return (
        f'<div class="table" tabindex="0" role="region" aria-label="{escape(table.caption)}">\n<table>\n'
        f"<caption>{escape(table.caption)}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n"
        "</table>\n</div>"
    )


def _heading(column: Column) -> str:
    unit = f' <span class="unit">[{escape(column.unit)}]</span>' if column.unit else ""
    return escape(column.title) + unit


def _by_column(table: Table) -> list[list[Cell]]:
    return [[row[index] for row in table.rows] for index in range(len(table.columns))]


def _is_numeric(cells: list[Cell]) -> bool:
    return not any(isinstance(cell, str | Level) for cell in cells)


def _row(columns: tuple[Column, ...], aligned: list[str], row: tuple[Cell, ...]) -> str:
    first, *others = (_cell(column, cell) for column, cell in zip(columns, row, strict=True))
    return f'<th scope="row"{aligned[0]}>{first}</th>' + "".join(
        f"<td{how}>{cell}</td>" for how, cell in zip(aligned[1:], others)
    )


def _cell(column: Column, cell: Cell) -> str:
    if isinstance(cell, Level):
        return f'<span class="{cell}">{_mark(cell)} {cell}</span>'
    if isinstance(cell, str):
        return escape(cell)
    if cell is None or math.isnan(cell):
        return '<span aria-label="none">–</span>'
    return escape(format(cell, "" if isinstance(cell, int) else column.format)).replace("-", "−")


def _provenance(provenance: Provenance) -> str:
    files = "".join(f"<li>{escape(one.name)} <code>sha256:{escape(one.sha256)}</code></li>" for one in provenance.data)
    return (
        f'<section class="provenance"><h2>Where this comes from</h2>\n<p>Command</p>\n<pre>{escape(provenance.command)}'
        f"</pre>\n{f'<p>Data</p><ul>{files}</ul>' if files else ''}\n</section>"
    )

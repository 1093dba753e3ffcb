"""Content of a report: text, tables, pictures and verdicts.

`abs_service.report.page` writes a report as an HTML page and as JSON with the same numbers.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.report.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Level(IntEnum):
    """Reliability of a result. The worst of a report is usually the exit code of its command."""

    GOOD = 0
    DOUBTFUL = 1
    BAD = 2

    def __str__(self) -> str:
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class Wording:
    """Words for the levels.

    Attributes:
        words: one for each level, beside a verdict.
        headlines: one sentence for each level that the worst of all verdicts may have.
    """

    words: Mapping[Level, str]
    headlines: Mapping[Level, str]


#: Wording for calibrations.
RELIANCE = Wording(
    {level: str(level) for level in Level},
    {
        Level.GOOD: "Good: this can be relied on.",
        Level.DOUBTFUL: "Doubtful: read the reasons before you rely on this.",
        Level.BAD: "Bad: do not use this.",
    },
)


@dataclass(frozen=True, slots=True)
class Verdict:
    """One judgement, in plain words.

    Attributes:
        level: reliability.
        text: one sentence with the decisive number.
        advice: recommended action; "" if none.
        about: the sensor, pair or board that it judges; "" for the whole.
    """

    level: Level
    text: str
    advice: str = ""
    about: str = ""


#: None and NaN are shown as a dash, a level as its mark.
Cell = str | float | Level | None


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table: heading, unit ("" if none) and the format of its numbers."""

    title: str
    unit: str = ""
    format: str = ".4g"


@dataclass(frozen=True, slots=True)
class Table:
    """A table: caption, columns, and rows of as many cells; the first cell of a row is its heading."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """An encoded picture: caption, alternative text, media type (`image/png`) and bytes."""

    caption: str
    alt: str
    media_type: str
    content: bytes = field(repr=False)


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a report under a heading of its own; paragraphs, tables and pictures in any order."""

    title: str
    blocks: tuple[str | Table | Picture, ...]


@dataclass(frozen=True)
class Report:
    """Results of a command.

    Attributes:
        title: such as "Calibration of rig demo".
        provenance: where it comes from.
        verdicts: judgements, the most important first.
        sections: the evidence.
        values: numbers for programs, by name; written to the JSON form unchanged.
        wording: words for the levels of the verdicts.
        exit_code: of the command; None for the worst level of the verdicts.
    """

    title: str
    provenance: Provenance
    verdicts: tuple[Verdict, ...]
    sections: tuple[Section, ...]
    values: Mapping[str, Any] = field(default_factory=dict)
    wording: Wording = RELIANCE
    exit_code: int | None = None

    @property
    def level(self) -> Level:
        """The worst of all verdicts, which is usually the exit code of the command, too; good if there are none."""
        return max((verdict.level for verdict in self.verdicts), default=Level.GOOD)


def drawing(figure: "Figure", caption: str, alt: str) -> Picture:
    """A matplotlib figure as a picture that stays sharp at every size."""
    import io  # noqa: PLC0415  together with matplotlib, which only those load who draw

    import matplotlib as mpl  # noqa: PLC0415

    buffer = io.BytesIO()
    # The same figure gives the same bytes: no date, and no random names inside.
    with mpl.rc_context({"svg.hashsalt": "abs-service"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return Picture(caption, alt, "image/svg+xml", buffer.getvalue())


def photo(image: NDArray[np.uint8], caption: str, alt: str) -> Picture:
    """A grey (height, width) or RGB (height, width, 3) image as a picture."""
    encoded = cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)[1]
    return Picture(caption, alt, "image/png", encoded.tobytes())


def to_json(report: Report) -> dict[str, Any]:
    """The report as plain data for `json.dumps`, numbers in full precision; NaN, which JSON lacks, is null."""
    return {
        "title": report.title,
        "verdict": report.wording.words[report.level],
        "exit_code": int(report.level if report.exit_code is None else report.exit_code),
        "verdicts": [_verdict(verdict, report.wording) for verdict in report.verdicts],
        "values": _plain(report.values),
        "sections": [
            {"title": section.title, "blocks": [_block(block) for block in section.blocks]}
            for section in report.sections
        ],
        "provenance": asdict(report.provenance),
    }


def _verdict(verdict: Verdict, wording: Wording) -> dict[str, str]:
    return asdict(verdict) | {"level": wording.words[verdict.level]}


def _block(block: str | Table | Picture) -> dict[str, Any]:
    if isinstance(block, str):
        return {"text": block}
    if isinstance(block, Picture):
        return {"picture": {"caption": block.caption, "alt": block.alt}}
    columns = [{"title": column.title, "unit": column.unit} for column in block.columns]
    return {"table": {"caption": block.caption, "columns": columns, "rows": _plain(block.rows)}}


def _plain(value: Any) -> Any:
    """Values for JSON: levels by name, arrays as lists."""
    if isinstance(value, Level):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

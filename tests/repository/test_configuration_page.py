"""docs/reference/configuration.md lists every key of a rig file as the code has it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest
from annotated_types import Gt, Interval
from pydantic import Field

from abs_service.config.tables.table import Table
from abs_service.config.tables.values import Stream
from tests.repository.configuration_page import PAGE, page, rows
from tests.repository.configuration_values import default_words, value_words


def test_the_page_is_what_the_code_says():
    assert PAGE.read_text(encoding="utf-8") == page(), (
        "docs/reference/configuration.md is out of date: .venv/bin/python -m tests.repository.configuration_page"
    )


def test_every_link_on_the_page_has_its_section():
    text = page()
    sections = {re.sub(r"[^a-z_]", "", heading) for heading in re.findall(r"^## (.*)", text.lower(), re.MULTILINE)}
    assert set(re.findall(r"\(#(.*?)\)", text)) <= sections


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (Annotated[float, Gt(0)], "number > 0"),
        (Annotated[int, Field(ge=1)], "integer ≥ 1"),
        (Annotated[float | None, Interval(gt=0, le=0.5)], "0 < number ≤ 0.5"),
        (Literal["auto"] | tuple[int, int], '`"auto"` or [integer, integer]'),
        (Annotated[tuple[float, ...], Field(max_length=8)], "[number, …], at most 8"),
        (Stream | Literal[""], '"sensor/stream" or `""`'),
    ],
)
def test_values_are_said_in_words(annotation, words):
    assert value_words(annotation) == words


@pytest.mark.parametrize(
    ("default", "words"),
    [
        (None, ""),
        ({"type": "sparse"}, '`type = "sparse"`'),
        (1 << 20, "`1_048_576`"),
        (True, "`true`"),
        (Path("a"), '`"a"`'),
    ],
)
def test_defaults_are_written_as_in_a_rig_file(default, words):
    assert default_words(default) == words


@dataclass(frozen=True)
class Parent:
    """Keys of several classes.

    Attributes:
        first, second: one meaning
            for two, a | b.
    """

    first: int
    second: float = 0.5


class Lacking(Table):
    """A table whose key has no description."""

    key: int


def test_a_row_has_the_meaning_of_the_docstring():
    assert list(rows("", Parent, {})) == [
        r"| `first` | integer | **required** | one meaning for two, a \| b. |",
        r"| `second` | number | `0.5` | one meaning for two, a \| b. |",
    ]


def test_a_key_without_description_is_refused():
    with pytest.raises(ValueError, match="Lacking: `Attributes:` lacks key"):
        list(rows("", Lacking, {}))

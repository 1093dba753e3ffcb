"""What docs/models.md says of the deformation models is so: their names, keys, defaults and tolerances."""

import dataclasses
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from abs_service.config import plugins
from abs_service.tracker.detection.rectangle_fit import LARGEST_BOW_M, LEAST_OVERLAP
from abs_service.tracker.models.parts import bends

PACKAGE = "abs_service.tracker.models"
PAGE = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")
TABLES = {
    tracker["model"]["type"]: tracker["model"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def test_every_model_has_a_row_and_a_table():
    assert set(TABLES) == set(plugins.available(PACKAGE))
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE.partition("## Keys")[0], re.MULTILINE)) == {"type", *TABLES}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_names_all_keys_with_their_defaults(name):
    made = plugins.load(PACKAGE, TABLES[name], Path())
    assert plugins.table(made).keys() == TABLES[name].keys()
    for field in dataclasses.fields(import_module(f"{PACKAGE}.{name}").Settings):
        if field.default is not dataclasses.MISSING:
            assert getattr(made, field.name) == field.default, field.name


def test_the_degrees_and_turns_of_bends_are_as_the_page_says():
    degrees = list(bends.DEGREES.values())
    assert f"of degree {', '.join(map(str, degrees[:-1]))} or {degrees[-1]}" in PAGE
    assert list(bends.DEGREES) == [1 / 3, 2 / 3, 4 / 3, 3]
    assert "a third of a turn, two thirds, four thirds or three turns" in PAGE


def test_what_is_no_sheet_is_as_the_page_says():
    assert f"arches by more than {LARGEST_BOW_M * 1e3:.0f} mm" in PAGE
    assert f"less than {LEAST_OVERLAP:.0%}".replace("%", " %") in PAGE

"""The TOML tables in docs/models.md load and contain every key of every deformation model with its default."""

import dataclasses
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from abs_service.config import plugins

PACKAGE = "abs_service.tracker.models"
PAGE = (Path(__file__).parents[4] / "docs" / "models.md").read_text(encoding="utf-8")
TABLES = {
    tracker["model"]["type"]: tracker["model"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def test_every_model_has_a_documented_table():
    assert set(TABLES) == set(plugins.available(PACKAGE))


@pytest.mark.parametrize("name", TABLES)
def test_a_documented_table_loads_and_names_all_keys_with_their_defaults(name):
    made = plugins.load(PACKAGE, TABLES[name], Path())
    assert plugins.table(made).keys() == TABLES[name].keys()
    for field in dataclasses.fields(import_module(f"{PACKAGE}.{name}").Settings):
        if field.default is not dataclasses.MISSING:
            assert getattr(made, field.name) == field.default, field.name

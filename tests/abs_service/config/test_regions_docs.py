"""What docs/regions.md shows works: it has a table for every region, with all of its keys."""

import re
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from abs_service.config import plugins

PACKAGE = "abs_service.tracker.detection.regions"
ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "regions.md").read_text(encoding="utf-8")
TABLES = [
    tracker["region"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
]
TYPES = sorted({table["type"] for table in TABLES})


def test_every_region_has_a_row_and_a_table_and_is_in_the_readme():
    assert plugins.available(PACKAGE) == TYPES
    assert all(f"| `{name}` | " in PAGE for name in TYPES)
    row = next(
        line for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines() if "docs/regions.md" in line
    )
    assert all(f"`{name}`" in row for name in TYPES)


@pytest.mark.parametrize("name", TYPES)
def test_the_tables_of_a_region_name_all_of_its_keys(name):
    tables = [table for table in TABLES if table["type"] == name]
    made = plugins.load(PACKAGE, tables[0], ROOT)
    assert set().union(*tables) - {"type"} == {field.name for field in fields(made)}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table["type"])
def test_optional_keys_have_their_defaults(table):
    made = plugins.load(PACKAGE, table, ROOT)
    for field in fields(made):
        if field.name != "grow" and field.default not in (MISSING, None):
            assert getattr(made, field.name) == field.default


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table["type"])
def test_paths_start_from_the_folder_of_the_rig_file(table):
    made = plugins.load(PACKAGE, table, ROOT)
    assert (made.file if table["type"] == "mask" else made.within) == ROOT / "mask.png"

"""What docs/regions.md shows works: it has a table for every region, with all of its keys."""

import re
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from abs_service.config import plugins

PACKAGE = "abs_service.tracker.detection.regions"
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "regions.md").read_text(encoding="utf-8")
TABLES = {
    tracker["region"]["type"]: tracker["region"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def test_every_region_has_a_row_and_a_table_and_is_in_the_readme():
    assert sorted(TABLES) == plugins.available(PACKAGE)
    assert all(f"| `{name}` | " in PAGE for name in TABLES)
    row = next(
        line for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines() if "docs/regions.md" in line
    )
    assert all(f"`{name}`" in row for name in TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_a_table_names_all_keys_of_its_region_with_their_defaults(name):
    made = plugins.load(PACKAGE, TABLES[name], ROOT)
    assert TABLES[name].keys() - {"type"} == {field.name for field in fields(made)}
    for field in fields(made):
        if field.default not in (MISSING, None):
            assert getattr(made, field.name) == field.default


@pytest.mark.parametrize("name", TABLES)
def test_paths_start_from_the_folder_of_the_rig_file(name):
    made = plugins.load(PACKAGE, TABLES[name], ROOT)
    assert made.file == ROOT / "mask.png" if name == "mask" else made.within == ROOT / "mask.png"

"""docs/optimizers.md agrees with the code: names, keys and defaults of the optimisers and the budget."""

import re
import tomllib
from pathlib import Path

import pytest

from abs_service.config import plugins
from abs_service.config.tables import TrackerTable
from abs_service.tracker.optimizers.base import Stop

PACKAGE = "abs_service.tracker.optimizers"
PAGE = (Path(__file__).parents[4] / "docs" / "optimizers.md").read_text(encoding="utf-8")
TABLES = {
    tracker["optimizer"]["type"]: tracker["optimizer"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def test_every_optimizer_has_a_row_and_a_table():
    assert set(TABLES) == set(plugins.available(PACKAGE))
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE.partition("## Keys")[0], re.MULTILINE)) == {"type", *TABLES}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_names_all_keys_with_their_defaults(name):
    assert plugins.table(plugins.load(PACKAGE, {"type": name}, Path())) == TABLES[name]


@pytest.mark.parametrize("key", ["budget_evaluations", "budget_ms"])
def test_the_budget_is_as_the_page_says(key):
    assert f"| `{key}` | {round(TrackerTable.model_fields[key].default)} |" in PAGE


def test_every_reason_to_stop_is_named():
    for stop in set(Stop) - {Stop.NOTHING}:
        assert f"`{stop.name}`" in PAGE

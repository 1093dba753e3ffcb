"""docs/reference/simulation.md documents all keys of the addresses."""

import re
from pathlib import Path

from drivers.simulated.address import KEYS, Address
from drivers.simulated.scenes import SCENES
from drivers.simulated.sensors.optics import BEAMS, OPTICS

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "simulation.md").read_text(encoding="utf-8")
TABLES = {
    title: set(re.findall(r"^\| `(\w+)` \|", text, re.M))
    for title, text in re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S)
}


def test_scenes_heads_and_keys_are_documented() -> None:
    assert TABLES["Scenes"] == set(SCENES)
    assert TABLES["Heads"] == {*OPTICS, *BEAMS}
    assert TABLES["Keys"] == set(KEYS) - set(OPTICS)


def test_defaults_are_those_of_the_address() -> None:
    defaults = dict(re.findall(r"^\| `(\w+)` \| `?([\w.,]+)`? \|", PAGE.partition("## Keys")[2], re.M))
    known = {key: value for key, value in defaults.items() if value != "never"}
    assert len(known) == len(KEYS) - len(OPTICS) - 3
    for key, value in known.items():
        expected = getattr(Address("sheet"), key)
        assert KEYS[key](value) == expected, key


def test_the_documented_beam_length() -> None:
    (length,) = {float(number) for number in re.findall(r"length_m = ([\d.]+)", PAGE)}
    assert abs(BEAMS["barrier"].length_m - length) < 1e-4

import pytest

from calib.files import nested
from calib.formats import opencv
from calib.formats.content import FormatError, Hints


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 100_000, ".".join("a" * 100_000) + " = 1", '"\\"".' * 100_000 + "a = 1"]
)
def test_toml_that_is_nested_too_deeply_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        nested.toml(text)


def test_toml_with_an_integer_that_is_too_long_is_refused_in_words_of_toml() -> None:
    with pytest.raises(ValueError, match=r"^an integer of more than 4300 digits$"):
        nested.toml("a = " + "1" * 5000)


def test_json_and_yaml_that_are_nested_too_deeply_are_refused() -> None:
    for read in (nested.json, nested.yaml):
        with pytest.raises(ValueError, match="nested too deeply"):
            read("[" * 100_000)


def test_what_people_write_is_read() -> None:
    key = ".".join("a" * nested.MAX_PARTS)
    table = nested.toml(f'x = [{", ".join(["1.5"] * 100)}]\ny = "{". " * 100}"\n{key} = 1\n')
    assert table["x"] == [1.5] * 100
    assert nested.yaml("a: [1, 2]") == {"a": [1, 2]}


@pytest.mark.parametrize("part", ["[", "{b: ", "- ", "-", "a: "])
def test_a_storage_that_ends_the_stack_of_opencv_is_refused(part: str) -> None:
    with pytest.raises(FormatError, match=r"not a FileStorage|no camera"):
        opencv.read("%YAML:1.0\n---\na:\n  " + part * 100_000, Hints("x"))

"""Writes docs/reference/configuration.md, every key of a rig file, from the configuration's annotations and docstrings.

.venv/bin/python -m tests.repository.configuration_page
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from abs_service.config import plugins
from abs_service.config.tables import values
from abs_service.config.tables.service import ServiceConfig
from tests.repository.configuration_values import WORDS, default_words, value_words

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "configuration.md"
INTRO = """\
# Every key of a rig file

<!-- Written by `.venv/bin/python -m tests.repository.configuration_page`: edit the docstrings that it is made from. -->

The sections follow the order of a rig file; `NAME` is a name of your choice.
[abs_service/config/demo.toml](../../abs_service/config/demo.toml) is a complete file to begin with,
[examples/rigs](../../examples/rigs) has others, and `abs-service check rig.toml` says which keys or values are wrong.

*value* is the type and range: an integer may stand for a number, but not "3" for 3; paths start from the folder of the
file that names them. A key without a default may be left out unless it is **required**. Equations and sections are
those of the paper."""


class Key(NamedTuple):
    """One key: the path of a table of this name, the annotation, the default, what it means, and the kind of table."""

    path: str
    annotation: Any
    default: Any
    meaning: str
    table: Any


def page() -> str:
    """The whole page."""
    return "\n\n".join([INTRO, "## Top level", *_section("", ServiceConfig, {})]) + "\n"


def _section(path: str, kind: type, places: dict[str, str]) -> Iterator[str]:
    """Keys of a table, then the tables in it; `places` says where a package of parts has its section."""
    yield from _body(path, kind, places)
    for key in _keys(path, kind):
        if key.table and places.get(getattr(key.table, "package", ""), key.path) == key.path:
            yield f"## `[{key.path}]`"
            if isinstance(key.table, values.Plugin):
                yield from _choices(key, places)
            else:
                settings = isinstance(key.table, values.SettingsOf)
                inner = import_module(key.table.module).Settings if settings else key.table
                yield from _section(key.path, inner, places)


def _choices(key: Key, places: dict[str, str]) -> Iterator[str]:
    packages = (key.table.package, *key.table.others)
    # Parts of other distributions are not on the page, whatever is installed where it is written.
    modules = {name: f"{at}.{name}" for at in packages for name in plugins.available(at) if find_spec(f"{at}.{name}")}
    default = key.default["type"] if isinstance(key.default, dict) else None
    names = sorted(modules, key=lambda name: (name != default, name))
    yield f"`type` is required in this table and decides on its other keys: {', '.join(f'`{name}`' for name in names)}."
    for name in names:
        yield f'### `[{key.path}]` `type = "{name}"`'
        yield from _body(key.path, import_module(modules[name]).Settings, places)


def _body(path: str, kind: type, places: dict[str, str]) -> Iterator[str]:
    if issubclass(kind, BaseModel):
        text = re.sub(r"^`.*?`: ", "", _sentence(kind))
        yield text[0].upper() + text[1:]
    else:  # The module says what `Settings` are of; a noise model that is its own `Settings` adds its formula.
        documented = [import_module(kind.__module__), *([kind] if kind.__name__ != "Settings" else [])]
        yield "  \n".join(map(_sentence, documented))
    table = "\n".join(rows(path, kind, places))
    yield f"| key | value | default | meaning |\n|---|---|---|---|\n{table}" if table else "No other keys."


def _sentence(documented: Any) -> str:
    return (inspect.getdoc(documented) or "").partition("\n\n")[0].replace("\n", " ")


def rows(path: str, kind: type, places: dict[str, str]) -> Iterator[str]:
    """A row for every key of a table."""
    for key in _keys(path, kind):
        plugin = isinstance(key.table, values.Plugin)
        target = places.setdefault(key.table.package, key.path) if plugin else key.path
        value = f"[table](#{re.sub(r'[^a-z_]', '', target.lower())})" if key.table else value_words(key.annotation)
        name = key.path.removesuffix(".NAME").rpartition(".")[2]
        yield f"| `{name}` | {value} | {default_words(key.default)} | {key.meaning} |"


def _keys(path: str, kind: type) -> list[Key]:
    hints = get_type_hints(kind, include_extras=True)
    if issubclass(kind, BaseModel):
        defaults = {name: field.get_default(call_default_factory=True) for name, field in kind.model_fields.items()}
    else:
        own_first = sorted(dataclasses.fields(kind), key=lambda field: field.name not in kind.__annotations__)
        defaults = {field.name: field.default for field in own_first}
        parts = {field.name: field.metadata["parts"] for field in dataclasses.fields(kind) if field.metadata}
        hints |= {name: Annotated[Any, values.Plugin(package)] for name, package in parts.items()}
    meanings = {name: text for one in reversed(kind.__mro__) for name, text in _described(one)}
    if lacking := defaults.keys() - meanings.keys():
        raise ValueError(f"{kind.__module__}.{kind.__name__}: `Attributes:` lacks {', '.join(sorted(lacking))}")
    tables = {name: _table(hints[name]) for name in defaults}
    named = {name: ".NAME" if tables[name] and get_origin(hints[name]) is dict else "" for name in defaults}
    paths = {name: f"{path}.{name}{named[name]}".removeprefix(".") for name in defaults}
    return [Key(paths[name], hints[name], defaults[name], meanings[name], tables[name]) for name in defaults]


def _described(kind: type) -> Iterator[tuple[str, str]]:
    """Names and descriptions below `Attributes:` of a docstring."""
    section = re.search(r"^Attributes:\n((?: .*\n?)*)", inspect.cleandoc(kind.__doc__ or ""), re.MULTILINE)
    for names, text in re.findall(r"^ {4}(\w[\w, ]*): (.*(?:\n {8}.*)*)", section[1] if section else "", re.MULTILINE):
        yield from ((name, " ".join(text.split()).replace("|", r"\|")) for name in names.split(", "))


def _table(annotation: Any) -> Any:
    """The model, `Plugin` or `SettingsOf` of a table, or of each of several named ones; None for a plain value."""
    if isinstance(annotation, values.Plugin | values.SettingsOf):
        return annotation
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel) and annotation not in WORDS:
        return annotation
    return next(filter(None, map(_table, get_args(annotation))), None)


def main() -> None:
    """Writes the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()

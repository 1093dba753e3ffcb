"""Exchangeable parts: `type = "nurbs"` names the module whose dataclass `Settings` takes the rest of the table.

The modules are those of a package such as `abs_service.tracker.models`, and those that installed distributions declare
as entry points of the group of that name (docs/how-to/extending).
"""

import difflib
import json
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from importlib import import_module
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from abs_service.config.problems import Problem, ProblemsError, allowed_instead, from_pydantic, unknown_key
from drivers.opening import entry_points


def available(*packages: str) -> list[str]:
    """The values of `type` that name a module with `Settings`; imports all modules of the packages."""
    own = {name for package in packages for name in _modules(package) if _is_part(package, name)}
    return sorted(own.union(*map(_installed, packages)))


def load(package: str, table: Any, base: Path, *others: str) -> Any:
    """The `Settings` of the module that a table's `type` names, from the other keys of the table.

    Args:
        package: dotted name of the package with the modules, such as `abs_service.tracker.models`.
        table: content of the TOML file.
        base: folder that relative paths among the settings start from.
        others: packages that have such modules as well.

    Raises:
        ProblemsError: no such module, one that cannot be imported, unknown keys, or values out of range; all of them.
    """
    packages = (package, *others)
    if not isinstance(table, dict) or not isinstance(table.get("type"), str):
        types = available(*packages)
        if isinstance(table, dict) and (misspelt := difflib.get_close_matches("type", table.keys() - {"type"}, n=1)):
            message = f'unknown key, did you mean "type"? types: {", ".join(types)}'
            raise ProblemsError([Problem((misspelt[0],), message)])
        example = f'{{ type = "{table if isinstance(table, str) and table in types else types[0]}", … }}'
        raise ProblemsError([Problem((), f"must be a table such as {example}; types: {', '.join(types)}", table)])
    name = table["type"]
    module = next(filter(None, (_module(package, name) for package in packages)), None)
    if module is None:
        raise ProblemsError([Problem(("type",), f"no such type, {allowed_instead(name, available(*packages))}", name)])
    if broken := _broken(packages, module):
        raise ProblemsError([Problem(("type",), broken, name)])
    return settings(module, {key: value for key, value in table.items() if key != "type"}, base)


def settings(module: str, table: Any, base: Path) -> Any:
    """The `Settings` of one module from a table without `type`.

    A field with the metadata `parts = PACKAGE` is a table with a `type` of its own, the `Settings` of a module there.

    Raises:
        ProblemsError: unknown keys or values out of range; all of them.
    """
    Settings = import_module(module).Settings
    if not isinstance(table, dict):
        raise ProblemsError([Problem((), "must be a table", table)])
    allowed = [field.name for field in fields(Settings)]
    # pydantic ignores unknown keys of standard dataclasses, so a misspelt optional key would pass in silence.
    problems = [unknown_key((key,), allowed) for key in table if key not in allowed]
    nested: dict[str, Any] = {}
    for key, package in _nested(Settings).items():
        try:
            nested |= {key: load(package, table[key], base)} if key in table else {}
        except ProblemsError as error:
            problems += [problem.under((key,)) for problem in error.problems]
    try:
        # JSON in strict mode is TOML's own type system: lists become tuples, but "3" is not a number.
        made = _adapter(Settings).validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise ProblemsError(problems + from_pydantic(error, lambda _: allowed)) from None
    if problems:
        raise ProblemsError(problems)
    values = {field.name: getattr(made, field.name) for field in fields(Settings)}
    paths = {name: base / value for name, value in values.items() if isinstance(value, Path)}
    return replace(made, **paths, **nested)


@cache
def _adapter(Settings: type) -> TypeAdapter[Any]:
    """Adapter of one module's `Settings`, made once: a rig file has some of them, and making one takes milliseconds."""
    return TypeAdapter(Settings)


def with_parts(made: Any) -> Iterator[Any]:
    """Settings, and those of the parts that they contain, at any depth."""
    yield made
    for name in _nested(made):
        yield from with_parts(getattr(made, name))


def _nested(Settings: Any) -> dict[str, str]:
    """The fields that are tables with a `type` of their own, and the packages that the types are modules of."""
    return {field.name: field.metadata["parts"] for field in fields(Settings) if "parts" in field.metadata}


def _module(package: str, name: str) -> str | None:
    """Dotted name of the module of a type; None if there is none."""
    own = name in _modules(package) and _is_part(package, name)
    return f"{package}.{name}" if own else _installed(package).get(name)


def _modules(package: str) -> set[str]:
    return {module.name for module in pkgutil.iter_modules(import_module(package).__path__)}


def _is_part(package: str, name: str) -> bool:
    return hasattr(import_module(f"{package}.{name}"), "Settings")


def _installed(package: str) -> dict[str, str]:
    """Modules by name that installed distributions declare for a package."""
    return {point.name: point.value for point in entry_points(package)}


def _broken(packages: tuple[str, ...], module: str) -> str:
    """Message about an installed module that cannot be used; "" if it can, or if it is one of ours."""
    for point in (point for package in packages for point in entry_points(package) if point.value == module):
        declared = f"entry point {point.name} = {module} of {point.dist.name if point.dist else 'a distribution'}"
        try:
            if not hasattr(import_module(module), "Settings"):
                return f"{declared} has no Settings"
        except Exception as error:  # other people's code, run as it is imported
            return f"{declared} cannot be imported: {type(error).__name__}: {error}"
    return ""


def table(made: Any) -> dict[str, Any]:
    """The TOML table that `load` makes the same settings from."""
    module = type(made).__module__
    installed = () if module.startswith(("abs_service.", "calib.")) else distributions()
    names = (point.name for one in installed for point in one.entry_points if point.value == module)
    return {"type": next(names, module.rpartition(".")[2]), **plain(made)}


def plain(made: Any) -> dict[str, Any]:
    """The TOML table that `settings` makes the same settings from."""
    values = _adapter(type(made)).dump_python(made, mode="json", exclude_none=True)
    return values | {name: table(getattr(made, name)) for name in _nested(made)}

"""TOML text to configuration and back."""

import json
import os
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from abs_service.config import addresses, references
from abs_service.config.errors import ConfigError, allowed_at, error_of
from abs_service.config.merging import merge, without_calibrated
from abs_service.config.problems import ProblemsError, from_pydantic
from abs_service.config.tables.service import ServiceConfig
from calib.files import limited, nested

_MEMORY = "/memfd:"  # where Linux says that files in memory are


def named(path: Path | None) -> str:
    """The name of a configuration's file in messages.

    Args:
        path: the file; of one in memory, which `run` has for its processes, the name is that of the file it comes
            from. None for the simulated rig.
    """
    if path is None:
        return "demo.toml"
    try:
        target = os.readlink(path)
    except OSError:
        return str(path)
    return target.removeprefix(_MEMORY).removesuffix(" (deleted)") if target.startswith(_MEMORY) else str(path)


def load(path: Path) -> ServiceConfig:
    """The configuration in a file; relative paths in it start from the file's folder.

    Raises:
        ConfigError: the file cannot be read or used; names all that is wrong with it.
    """
    if path.suffix == ".mcap":
        raise ConfigError(f"{path}: this is a recording, not a configuration; `abs-service replay` tracks it")
    try:
        text = limited.text(path)
    except OSError as error:
        raise ConfigError(f"{named(path)}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: TOML is UTF-8 text, byte {error.start} is not") from None
    return loads(text, named(path), path.resolve().parent)


def load_default() -> ServiceConfig:
    """The simulated rig that comes with the service; it records below the current directory."""
    text = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    return loads(text, named(None), Path.cwd())


def loads(text: str, source: str, base: Path) -> ServiceConfig:
    """The configuration in a text.

    Args:
        text: TOML.
        source: where it came from, for messages.
        base: folder that relative paths start from.

    Raises:
        ConfigError: names all that is wrong.
    """
    try:
        file = nested.toml(text)
    except ValueError as error:
        raise ConfigError(f"{source}: not TOML: {error}") from None
    return from_tables(file, source, base, text)


def from_tables(file: dict[str, Any], source: str, base: Path, text: str = "") -> ServiceConfig:
    """The configuration in the tables of a TOML file.

    Args:
        file: the tables.
        source: where they came from, for messages.
        base: folder that relative paths start from.
        text: the TOML that they were read from, for the numbers of its lines; "" if they are no file's.

    Raises:
        ConfigError: names all that is wrong.
    """
    try:
        merged = merge(file, source, base, text)
    except ConfigError as error:
        # Besides the calibration's errors, only those are reported that do not depend on it.
        try:
            _checked({**file, "calibration": None}, base, text)
        except ProblemsError as others:
            if left := without_calibrated(others.problems):
                raise ConfigError(f"{error}\n{error_of(source, left, text)}") from None
        raise
    try:
        return _checked(merged, base, text)
    except ProblemsError as error:
        raise error_of(source, error.problems, text) from None


def _checked(file: dict[str, Any], base: Path, text: str) -> ServiceConfig:
    """The configuration in merged tables.

    Raises:
        ProblemsError: all that is wrong.
    """
    # The default directory of recordings starts from `base`, so it has to be made here.
    file = {"record": {}} | file
    problems = references.check(file)
    try:
        # JSON in strict mode is TOML's own type system: lists become tuples, but "3" is not a number.
        config = ServiceConfig.model_validate_json(json.dumps(file, default=str), strict=True, context={"base": base})
    except ValidationError as error:
        problems = from_pydantic(error, partial(allowed_at, ServiceConfig)) + problems
    else:
        if not problems:
            return config
    # Importing drivers takes long; in a file without other mistakes, what opens its devices checks the addresses.
    raise ProblemsError([*problems, *(addresses.check(references.uris(file)) if text else [])])


def to_toml(config: ServiceConfig) -> str:
    """The effective configuration, defaults included and paths absolute; `loads` makes an equal one from it."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))

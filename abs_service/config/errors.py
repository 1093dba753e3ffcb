"""The error of an invalid configuration, with all problems in it."""

from collections.abc import Collection, Iterable
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from abs_service.config.positions import located
from abs_service.config.problems import Key, Problem


class ConfigError(Exception):
    """An invalid configuration; the message names the file and each problem: key, value, the allowed values."""


def error_of(source: str, problems: Iterable[Problem], text: str) -> ConfigError:
    """All problems of a file as one error.

    Args:
        source: name of the file.
        problems: its errors.
        text: its content, for the numbers of the lines; "" if there is none.
    """
    found = located(problems, text)
    if len(found) == 1:
        return ConfigError(f"{source}: {found[0]}")
    return ConfigError("\n".join([f"{source}: {len(found)} errors", *(f"  {problem}" for problem in found)]))


def allowed_at(root: type[BaseModel], key: Key) -> Collection[str]:
    """The keys that the table at a path may hold, in a file whose whole is a `root`."""
    annotation: Any = root
    for part in key:
        # A table is a field of a model or a named entry of a dictionary of models.
        entries = get_origin(annotation) is dict
        annotation = get_args(annotation)[1] if entries else _model(annotation).model_fields[str(part)].annotation
    return _model(annotation).model_fields


def _model(annotation: Any) -> type[BaseModel]:
    choices = (annotation, *get_args(annotation))
    return next(choice for choice in choices if isinstance(choice, type) and issubclass(choice, BaseModel))

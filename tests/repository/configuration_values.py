"""Types, ranges and defaults of the configuration in words, for docs/reference/configuration.md."""

import json
from collections.abc import Iterable
from dataclasses import MISSING
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from abs_service.config.tables import values
from abs_service.config.tables.calibration import CalibrationOrigin

#: Types of which one word says what they are, or an example.
WORDS: dict[Any, str] = {
    **{bool: "true or false", int: "integer", float: "number", str: "text", Path: "path", values.RelativePath: "path"},
    **{values.Name: "name", values.Stream: '"sensor/stream"', values.Endpoint: '"protocol/address:port"'},
    **{values.DeviceUri: '"driver:…"', CalibrationOrigin: "path"},
}


def value_words(annotation: Any) -> str:
    """The type and the range of a value in words."""
    inner = get_args(annotation)
    if annotation in WORDS:
        return WORDS[annotation]
    if get_origin(annotation) is Annotated:
        # `Interval` and pydantic's `Field` hold several limits.
        limits = [
            it for one in inner[1:] for it in getattr(one, "metadata", one if hasattr(one, "__iter__") else [one])
        ]
        return _limited(value_words(inner[0]), limits)
    if get_origin(annotation) is Literal:
        return " or ".join(f"`{json.dumps(word)}`" for word in inner)
    if get_origin(annotation) is tuple:
        return "[" + ", ".join("…" if one is ... else value_words(one) for one in inner) + "]"
    if get_origin(annotation) is dict:
        return f"table of {value_words(inner[1])}"
    return " or ".join(value_words(one) for one in inner if one is not NoneType)


def _limited(word: str, limits: Iterable[Any]) -> str:
    names = ("gt", "ge", "lt", "le", "max_length")
    of = {name: getattr(limit, name) for limit in limits for name in names if getattr(limit, name, None) is not None}
    low = next(((_number(of[name]), sign) for name, sign in (("gt", "<"), ("ge", "≤")) if name in of), None)
    high = next((f" {sign} {_number(of[name])}" for name, sign in (("lt", "<"), ("le", "≤")) if name in of), "")
    if low and high:
        return f"{low[0]} {low[1]} {word}{high}"
    length = f", at most {of['max_length']}" if "max_length" in of else ""
    return f"{word} {'>' if low[1] == '<' else '≥'} {low[0]}" if low else word + high + length


def default_words(value: Any) -> str:
    """The default as TOML writes it; nothing for None and for tables whose keys all have defaults."""
    if value in (MISSING, PydanticUndefined):
        return "**required**"
    if value in (None, {}) or isinstance(value, BaseModel):
        return ""
    if isinstance(value, dict):
        return f'`type = "{value["type"]}"`'
    return f"`{_number(value) if type(value) is int else json.dumps(value, default=str)}`"


def _number(value: float) -> str:
    return f"{value:_}" if abs(value) >= 1e4 else f"{value:g}"

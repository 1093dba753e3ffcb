"""TOML formatting for people: comments, short arrays on one line, matrices row by row."""

from collections.abc import Mapping, Sequence
from typing import Any

import tomli_w

_WIDTH = 110


def table(key: Sequence[str], content: Mapping[str, Any], comment: str = "") -> str:
    """Table with its heading; the root table if the key is empty."""
    heading = f"[{'.'.join(key)}]\n" if key else ""
    lines = "".join(f"{name} = {value(part)}\n" for name, part in content.items())
    return f"{f'# {comment}' + chr(10) if comment else ''}{heading}{lines}"


def value(given: Any) -> str:
    """TOML literal of a value; floats round-trip exactly."""
    if isinstance(given, Mapping):
        return "{ " + ", ".join(f"{name} = {value(part)}" for name, part in given.items()) + " }"
    if isinstance(given, list | tuple):
        parts = [value(part) for part in given]
        line = f"[{', '.join(parts)}]"
        nested = any(isinstance(part, list | tuple | Mapping) for part in given)
        if len(line) <= _WIDTH or not nested:
            return line
        return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"
    return tomli_w.dumps({"x": given}).removeprefix("x = ").rstrip("\n")

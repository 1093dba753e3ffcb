"""TOML, JSON and YAML, whose parsers recurse: a text that is nested too deeply is a `ValueError`."""

import json as json_library
import re
import sys
import tomllib
from typing import Any

import yaml as yaml_library

#: Most parts of a dotted key. The library takes memory for each with all before it: 10 GB for 100,000.
MAX_PARTS = 32
_DOTTED = re.compile(rf"""(?:\.[ \t]*+(?:[\w-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+')[ \t]*+){{{MAX_PARTS}}}""")

_TOO_DEEP = "its tables are nested too deeply"


def toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises:
        ValueError: `tomllib.TOMLDecodeError`, tables that are nested too deeply, or an integer that is too long.
    """
    if _DOTTED.search(text):
        raise ValueError(f"a key of more than {MAX_PARTS} parts; {_TOO_DEEP}")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # of `int`, with a call of Python as the remedy
        raise ValueError(f"an integer of more than {sys.get_int_max_str_digits()} digits") from None


def json(text: str) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: `json.JSONDecodeError`, or values that are nested too deeply.
    """
    try:
        return json_library.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None


def yaml(text: str) -> Any:
    """The value of a YAML text.

    Raises:
        ValueError: no YAML, or values that are nested too deeply.
    """
    try:
        return yaml_library.safe_load(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except (yaml_library.YAMLError, ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"not YAML: {error}") from error

"""Problems of a configuration as messages for its author."""

import difflib
import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

Key = tuple[str | int, ...]

#: Parts of pydantic's paths that are no keys: the alternatives of a union, and what is wrong about a key itself.
_ALTERNATIVE = re.compile(r"\[key\]|literal\[.*\]|tuple\[.*\]|constrained-\w+")

#: Marks "no value given", which differs from None.
ABSENT: Any = object()


@dataclass(frozen=True)
class Problem:
    """One problem: key, value and the allowed values.

    Attributes:
        key: path of the key from the root of the table.
        message: the allowed values, without the key.
        value: the given one; `ABSENT` if there is none.
    """

    key: Key
    message: str
    value: Any = ABSENT

    def under(self, prefix: Iterable[str | int]) -> "Problem":
        """The same problem seen from a table further out."""
        return replace(self, key=(*prefix, *self.key))

    def __str__(self) -> str:
        given = "" if self.value is ABSENT else f" = {_shown(self.value)}"
        return f"{dotted(self.key)}{given}: {self.message}"


class ProblemsError(ValueError):
    """Several problems at once. A `ValueError`, so that pydantic's validators may raise it."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(map(str, self.problems)))


def dotted(key: Key) -> str:
    """The key as a TOML file names it: `trackers.sheet.model.degree`, `sensors.tof.camera.lens[2]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key)
    return text.removeprefix(".") or "(file)"


def allowed_instead(name: str, allowed: Collection[str]) -> str:
    """Hint for an unknown name: the closest allowed one and the list of all."""
    close = difflib.get_close_matches(name, allowed, n=1)
    guess = f'did you mean "{close[0]}"? ' if close else ""
    return f"{guess}allowed: {', '.join(sorted(allowed)) or 'none'}"


def unknown_key(key: Key, allowed: Collection[str]) -> Problem:
    """The problem of an unknown key."""
    return Problem(key, f"unknown key, {allowed_instead(str(key[-1]), allowed)}")


def from_pydantic(error: ValidationError, allowed_at: Callable[[Key], Collection[str]]) -> list[Problem]:
    """All problems that pydantic found.

    Args:
        error: raised by validation.
        allowed_at: the keys that the table at a path may hold.
    """
    found: list[Problem] = []
    words = dict[Key, str]()  # what a key may be instead of numbers: "auto"
    for detail in error.errors(include_url=False):
        key = tuple(part for part in detail["loc"] if not _ALTERNATIVE.fullmatch(str(part)))
        if detail["type"] == "literal_error" and key != detail["loc"]:
            words[key] = detail.get("ctx", {}).get("expected", "")
            continue
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, ProblemsError):
            found += [problem.under(key) for problem in cause.problems]
        elif detail["type"] == "extra_forbidden":
            found.append(unknown_key(key, allowed_at(key[:-1])))
        elif detail["type"] == "missing":
            found.append(Problem(key, "missing, but needed"))
        else:
            message = detail["msg"].removeprefix("Value error, ")
            for subject in ("Input", "String", "Tuple", "List", "Object"):
                message = message.replace(f"{subject} should", "must")
            found.append(Problem(key, message, detail["input"]))
    return [_or_word(problem, words) for problem in found]


def _or_word(problem: Problem, words: Mapping[Key, str]) -> Problem:
    """The problem of a value that may also be a word, with that word."""
    word = words.get(problem.key)
    return problem if word is None else replace(problem, message=f"{problem.message}, or {word}")


def _shown(value: Any, limit: int = 60) -> str:
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= limit else text[: limit - 1] + "…"

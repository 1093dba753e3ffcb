"""Line numbers of the keys of a TOML text, which `tomllib` does not give."""

import re
import tomllib
from collections.abc import Iterable

from abs_service.config.problems import Key, Problem

_TOKEN = re.compile(
    r"""(?xs)
    \"\"\" (?: \\. | [^\\] )*? \"\"\"+ | '''.*?'''+ | "(?: \\. | [^"\\] )*" | '[^']*'
    | \#[^\n]* | \n | [ \t\r]+ | [\[\]{}=,.] | [^\s\[\]{}=,.\#"']+
    """
)
_ENDS_VALUE = frozenset("\n,]}")


def located(problems: Iterable[Problem], text: str) -> list[str]:
    """Messages of problems, in the order of the lines that they are on, with these.

    Args:
        problems: problems of a file.
        text: TOML that `tomllib` reads; "" if the tables come from elsewhere, and have no lines.
    """
    lines = key_lines(text)
    placed = [(next((lines[k] for k in _outwards(one.key) if k in lines), 0), one) for one in problems]
    placed.sort(key=lambda pair: pair[0])
    return [f"line {line}: {problem}" if line else str(problem) for line, problem in placed]


def key_lines(text: str) -> dict[Key, int]:
    """The line of each key, table and element of an array, counted from 1, in TOML that `tomllib` reads."""
    scan = _Scan(text)
    scan.document()
    return scan.lines


def _outwards(key: Key) -> Iterable[Key]:
    """A key and the tables around it; a missing key has the position where it belongs."""
    return (key[:length] for length in range(len(key), 0, -1))


class _Scan:
    """One pass over the tokens of a text. It relies on the text's being valid."""

    def __init__(self, text: str) -> None:
        self.lines: dict[Key, int] = {}
        self._tokens: list[tuple[str, int]] = []
        self._at = 0
        self._lengths: dict[Key, int] = {}  # of the arrays of tables so far
        line = 1
        for match in _TOKEN.finditer(text):
            token = match[0]
            if token == "\n" or not (token.isspace() or token.startswith("#")):
                self._tokens.append((token, line))
            line += token.count("\n")

    def document(self) -> None:
        table: Key = ()
        while self._at < len(self._tokens):
            if self._token == "[":
                table = self._header()
            elif not self._skipped("\n"):
                self._pair(table)

    @property
    def _token(self) -> str:
        return self._tokens[self._at][0] if self._at < len(self._tokens) else "\n"

    def _skipped(self, *tokens: str) -> bool:
        begin = self._at
        while self._at < len(self._tokens) and self._token in tokens:
            self._at += 1
        return self._at > begin

    def _note(self, table: Key, key: Key, line: int) -> Key:
        """Remembers where a key is mentioned first, and each table that its dots imply; returns its whole path."""
        for part in key:
            table = (*table, part)
            self.lines.setdefault(table, line)
            if table in self._lengths:
                table = (*table, self._lengths[table] - 1)
        return table

    def _header(self) -> Key:
        line, begin = self._tokens[self._at][1], self._at
        self._skipped("[")
        repeated = self._at - begin == 2
        *outer, last = self._key()
        table = (*self._note((), tuple(outer), line), last)
        self._skipped("]")
        if not repeated:
            return self._note(table[:-1], (last,), line)
        self._lengths[table] = self._lengths.get(table, 0) + 1
        entry = self._note(table[:-1], (last,), line)
        self.lines[entry] = line
        return entry

    def _pair(self, table: Key) -> None:
        line = self._tokens[self._at][1]
        path = self._note(table, self._key(), line)
        self._skipped("=")
        self._value(path)

    def _key(self) -> Key:
        parts: list[str] = []
        while self._token not in ("=", "]"):
            token = self._token
            if token != ".":
                parts.append(tomllib.loads(f"key = {token}")["key"] if token[0] in "\"'" else token)
            self._at += 1
        return tuple(parts)

    def _value(self, path: Key) -> None:
        if self._token == "[":
            self._at += 1
            self._elements(path)
        elif self._token == "{":
            self._at += 1
            while not (self._skipped("\n", ",") and self._token == "}") and self._token != "}":
                self._pair(path)
        else:
            while self._token not in _ENDS_VALUE:
                self._at += 1
            return
        self._at += 1  # the closing bracket

    def _elements(self, path: Key) -> None:
        index = 0
        self._skipped("\n")
        while self._token != "]":
            self.lines[*path, index] = self._tokens[self._at][1]
            self._value((*path, index))
            self._skipped("\n", ",")
            index += 1

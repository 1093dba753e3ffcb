"""Names and text that may go into keys, files and terminals, whoever wrote them."""

import re

#: Longest text [characters].
MAX_LENGTH = 1 << 14

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_LINES = str.maketrans("\n\t", "  ")


def is_name(text: str) -> bool:
    """True if a text can be a part of a key: 1 to 64 letters, digits, - and _, not beginning with - or _."""
    return _NAME.fullmatch(text) is not None


def is_printable(text: str, maximum: int = MAX_LENGTH) -> bool:
    """True if a text is not too long and moves no cursor: all characters can be printed, or end a line."""
    return len(text) <= maximum and text.translate(_LINES).isprintable()


def printable(text: str) -> str:
    """The text as `is_printable` allows it: other characters as escapes, the end cut off."""
    if is_printable(text):
        return text
    shown = (c if c in "\n\t" or c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
    return "".join(shown)[:MAX_LENGTH]

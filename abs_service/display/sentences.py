"""Reasons and doubts of the tracker, which begin with small letters, as a text."""

from collections.abc import Iterable


def sentences(clauses: Iterable[str]) -> str:
    """Each clause with a capital letter and a full stop, unless it ends with one or asks."""
    return " ".join(one[:1].upper() + one[1:] + ("" if one.endswith((".", "?")) else ".") for one in clauses if one)

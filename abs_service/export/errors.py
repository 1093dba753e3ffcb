"""Errors of exports."""


class ExportError(Exception):
    """A recording that cannot be exported, or an output that cannot be written; names the file and the problem."""

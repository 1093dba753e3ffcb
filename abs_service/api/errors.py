"""The error of a call."""


class ArgumentError(ValueError):
    """An argument that cannot be used; the message names it, its value and the allowed values."""

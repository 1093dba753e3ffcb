"""Errors of this package."""


class ClientError(Exception):
    """Base class of this package's errors."""


class UnreachableError(ClientError, ConnectionError):
    """Endpoint that does not answer, or refuses this program."""


class UnknownNameError(ClientError, ValueError):
    """A name, an endpoint or a file that cannot be one."""


class RangeError(ClientError, ValueError):
    """A number outside its range."""


class MalformedError(ClientError, ValueError):
    """A message that cannot be read."""

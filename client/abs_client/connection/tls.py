"""Certificates of a program."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from abs_client.errors import UnknownNameError


@dataclass(frozen=True)
class Tls:
    """The files by which this program proves who it is, as `abs-service keys` makes them.

    Attributes:
        authority: certificate of the lab's authority.
        certificate, key: of this program, `viewer` or `operator`.

    Raises:
        UnknownNameError: one of them is no file.
    """

    authority: str | PathLike[str]
    certificate: str | PathLike[str]
    key: str | PathLike[str]

    def __post_init__(self) -> None:
        # Looked for here: zenoh tries for seconds, and then it looks as if nothing answered.
        for path in (self.authority, self.certificate, self.key):
            if not Path(path).is_file():
                raise UnknownNameError(f"{path} is no file: `abs-service keys` makes the certificates")

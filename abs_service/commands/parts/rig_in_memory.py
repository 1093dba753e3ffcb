"""The configuration that the processes of a running rig read: a file in memory, whose content can be exchanged."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from abs_service import config
from abs_service.config import changes
from abs_service.supervision.exit_codes import is_for_user
from abs_service.wire.commands import RefusedError

#: Longest name that Linux lets a file in memory have [bytes].
MAX_NAME_LENGTH = 249


class RigInMemory:
    """A configuration as a file.

    Args:
        rig: the configuration.
        stream: of a file in memory; open as long as this is used.
    """

    def __init__(self, rig: config.ServiceConfig, stream: IO[bytes]) -> None:
        self._stream = stream
        self.path = Path(f"/proc/{os.getpid()}/fd/{stream.fileno()}")
        self.write(rig)

    def write(self, rig: config.ServiceConfig) -> None:
        """Puts another configuration in place of this one.

        Raises:
            ConfigError: it has a file name that is not UTF-8.
        """
        text = config.to_toml(rig)
        try:
            content = text.encode()
        except UnicodeEncodeError as error:
            line = text.splitlines()[text.count("\n", 0, error.start)]
            raise config.ConfigError(f"{line}: this name is not UTF-8; rename it, or set LANG=C.UTF-8") from None
        os.pwrite(self._stream.fileno(), content, 0)
        os.truncate(self._stream.fileno(), len(content))
        self.rig = rig

    def lacks_some(self, new: config.ServiceConfig) -> bool:
        """True if another configuration lacks some of the processes that this one has."""
        return bool(changes.between(self.rig, new).ends)

    def exchange(self, read: Callable[[], config.ServiceConfig]) -> changes.Changes:
        """Takes over a configuration, which `read` reads, if it can be used without an end of the rig.

        Raises:
            RefusedError: it cannot; everything stays as it was.
        """
        try:
            new = read()
        except Exception as error:
            if is_for_user(error):
                raise RefusedError(str(error)) from None
            raise
        if self._stream.closed:
            raise RefusedError("the rig ends")
        found = changes.between(self.rig, new)
        if found.fixed:
            keys = ", ".join(found.fixed)
            raise RefusedError(f"{keys}: can change only when the rig is stopped and started; nothing was taken over")
        self.write(new)
        return found


@contextmanager
def in_memory(rig: config.ServiceConfig, source: str) -> Iterator[RigInMemory]:
    """A configuration as a file of which nothing is left when this process ends, however it ends.

    Args:
        rig: the configuration.
        source: the file that it comes from, for messages (`config.named`); of a long path, they have the end.
    """
    with open(os.memfd_create(os.fsencode(source)[-MAX_NAME_LENGTH:].decode(errors="ignore")), "wb") as stream:
        yield RigInMemory(rig, stream)

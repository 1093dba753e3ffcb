"""Starts the emulated processing unit, and injects faults into its heads."""

import subprocess
import sys
from pathlib import Path
from types import TracebackType
from xmlrpc.client import ServerProxy

from tests.drivers.o3r.emulated_unit import PATH, SERIALS


class UnitProcess:
    """A running unit.

    Args:
        message: file with the body of a message, sent instead of synthetic ones.
    """

    def __init__(self, message: Path | None = None) -> None:
        command = [sys.executable, "-m", "tests.drivers.o3r.emulated_unit", *([str(message)] if message else [])]
        root = Path(__file__).parents[3]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root)
        assert self._process.stdout is not None
        self._output = self._process.stdout
        self.port = int(self._output.readline())

    def __enter__(self) -> "UnitProcess":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def uri(self, serial: str = SERIALS[0]) -> str:
        """Address of a head."""
        return f"o3r://127.0.0.1:{self.port}?head={serial}"

    def emulate(self, serial: str = SERIALS[0], fault: str = "none", state: str = "RUN") -> None:
        """Gives a head a fault in every run from now on, and a state in the configuration."""
        with ServerProxy(f"http://127.0.0.1:{self.port}{PATH}") as unit:
            unit.emulate(serial, fault, state)

    def kill(self) -> None:
        """Ends the unit; its connections break."""
        self._process.kill()
        self._process.wait()
        self._output.close()

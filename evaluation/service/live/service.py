"""The service as a user starts it: a process that starts the others."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Self

from evaluation.service.live import proc


class ServiceError(Exception):
    """The service ended by itself; the message is its last output."""


class Service:
    """`abs-service run RIG`, from its start to its end; a context manager that ends it.

    Args:
        rig: the rig file.
        environment: variables that it gets besides those of this process.

    Attributes:
        started_ns: when it was started, CLOCK_MONOTONIC [ns].
    """

    def __init__(self, rig: Path, environment: Mapping[str, str] = MappingProxyType({})) -> None:
        self._log = rig.parent / "output.jsonl"
        self.started_ns = time.monotonic_ns()
        command = [sys.executable, "-m", "abs_service", "run", str(rig), "--json"]
        with self._log.open("wb") as log:  # a pipe that is not read would block the service
            self._process = subprocess.Popen(
                command, stdout=log, stderr=subprocess.STDOUT, env=os.environ | environment
            )

    def processes(self) -> Mapping[str, int]:
        """Numbers of the processes that run, by the command of each: run, capture, track, record."""
        return {"run": self._process.pid, **proc.children(self._process.pid)}

    def every_process(self) -> list[tuple[str, int]]:
        """All processes that run, several of one command included: command and number of each."""
        return [("run", self._process.pid), *proc.every_child(self._process.pid)]

    def check(self) -> None:
        """Checks that the service runs.

        Raises:
            ServiceError: it has ended.
        """
        code = self._process.poll()
        if code is not None:
            last = self._log.read_text(encoding="utf-8").strip().rpartition("\n")[2]
            raise ServiceError(f"the service ended by itself with code {code}: {last}")

    def stop(self, timeout_s: float = 15.0, number: signal.Signals = signal.SIGINT) -> int:
        """Asks it to end by a signal and returns its exit code; negative if it had to be killed."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

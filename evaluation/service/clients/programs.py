"""Programs that print the age of every estimate, and their output."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_AGE = re.compile(r"here\s+([\d.]+) ms")
#: Time at the beginning that does not count, and by when a program has printed its first line [s].
WARM_UP_S, START_S = 1.0, 30.0


@dataclass(frozen=True)
class Program:
    """A program that prints `here … ms` for every estimate.

    Attributes:
        name: language and way.
        source: its file.
        command: that starts it.
    """

    name: str
    source: Path
    command: tuple[str, ...]


def ages_ms(program: Program, duration_s: float) -> NDArray[np.float64]:
    """Ages that a program prints in a time, after a warm-up [ms]; one NaN if it prints none."""
    with subprocess.Popen(program.command, stdout=subprocess.PIPE, text=True, env=_environment()) as process:
        watchdog = threading.Timer(START_S + WARM_UP_S + duration_s, process.kill)
        watchdog.start()
        ages, begin_s = [], None
        for line in process.stdout or ():
            begin_s = begin_s or time.monotonic()
            if (match := _AGE.search(line)) and time.monotonic() > begin_s + WARM_UP_S:
                ages.append(float(match[1]))
            if time.monotonic() > begin_s + WARM_UP_S + duration_s:
                break
        watchdog.cancel()
        process.kill()
    return np.array(ages or [np.nan])


@contextmanager
def started(command: Sequence[str], folder: Path) -> Iterator[None]:
    """Runs a program beside the block, once it has printed its first line; what it says goes to `folder`."""
    with (folder / "errors").open("ab") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, env=_environment())
        try:
            next(iter(process.stdout or ()))
            yield
        finally:
            process.terminate()
            process.wait()
            if process.stdout:
                process.stdout.close()


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}

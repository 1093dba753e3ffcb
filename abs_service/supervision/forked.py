"""Processes that a fork server forks, which has imported everything: a start, or a start after a fault, is short.

Python takes seconds to import what tracks, and each process of a rig would take them for itself. The fork server is
that of `multiprocessing`: it has no threads, and does nothing but import and fork.
"""

import atexit
import ctypes
import multiprocessing
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from multiprocessing import forkserver, util
from multiprocessing.connection import Connection

from setproctitle import setproctitle

from abs_service.supervision import parent_watchdog

#: Makes processes that the fork server forks.
CONTEXT = multiprocessing.get_context("forkserver")

_PR_SET_CHILD_SUBREAPER = 36
#: Environment variable with the folder of the fork server's socket.
_FOLDER = "ABS_SERVICE_FORK_FOLDER"


def preload(module: str) -> None:
    """Starts the fork server, which forks as soon as it has imported the module.

    Should it die, this process becomes the parent of its children: prctl(2), PR_SET_CHILD_SUBREAPER.
    """
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    os.environ[_FOLDER] = util.get_temp_dir()
    CONTEXT.set_forkserver_preload([module])
    forkserver.ensure_running()


def ensure_running() -> None:
    """Starts the fork server anew if it has died, so that it is ready when it is needed; its children live on."""
    forkserver.ensure_running()


def detach() -> None:
    """In the fork server: leaves the terminal, or whoever reads our output, to `run`.

    It ends when `run` has ended, and removes what `run` cannot if it was killed.
    """
    setproctitle("abs-service fork-server")
    atexit.register(shutil.rmtree, os.environ.pop(_FOLDER), ignore_errors=True)
    with open(os.devnull, "r+b", buffering=0) as null:
        for descriptor in (0, 1, 2):
            os.dup2(null.fileno(), descriptor)


def begin(
    stdin: Connection, output: Connection, program: Callable[[Sequence[str]], None], arguments: Sequence[str]
) -> None:
    """Runs a program in this process, which was just forked.

    Args:
        stdin: becomes its standard input, which the parent watchdog reads.
        output: becomes its standard output and standard error.
        program: runs the arguments.
        arguments: its command line.
    """
    os.setpgid(0, 0)  # Ctrl-C in the terminal reaches only the supervisor, which stops the children in order
    with stdin, output:
        for descriptor, end in ((0, stdin), (1, output), (2, output)):
            os.dup2(end.fileno(), descriptor)
    # Anew, since they know the encoding and kind of the fork server's; the parent reads UTF-8.
    sys.stdout = os.fdopen(1, "w", buffering=1, encoding="utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False)
    os.environ |= {parent_watchdog.VARIABLE: "1"}
    setproctitle(" ".join(("abs-service", *arguments)))
    program(arguments)


def abs_service(arguments: Sequence[str]) -> None:
    """`abs-service ARGUMENTS`."""
    sys.argv = ["abs-service", *arguments]
    import_module("abs_service.cli").program()

"""Processes that a fork server forks, which has imported everything: a start, or a start after a fault, is short.

Python takes seconds to import what tracks, and each process of a rig would take them for itself. The fork server is
that of `multiprocessing`: it has no threads, and does nothing but import and fork.
"""

import atexit
import ctypes
import multiprocessing
import os
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing import current_process, forkserver, resource_tracker, util
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from setproctitle import setproctitle

from abs_service.supervision.children import parent_watchdog
from abs_service.supervision.process_setup import standard_files

#: Makes processes that the fork server forks.
CONTEXT = multiprocessing.get_context("forkserver")

#: Limit of open files that a rig asks for: each restart of a process costs the others two or three until they end.
FILES = 65_536
#: Longest temporary folder in which the path of the fork server's socket, 39 bytes longer, has the 107 that unix(7)
#: permits [bytes].
MAX_PARENT_LENGTH = 64

#: For want of memory, the kernel ends first what has so much more of 1000 in its score: not `run`, which starts the
#: others again, and is larger than they by shared memory that they had. As much as systemd gives a user's programs.
OOM_SCORE = 200
_OOM_SCORE_ADJ, _MAX_OOM_SCORE = Path("/proc/self/oom_score_adj"), 1000

_PR_SET_CHILD_SUBREAPER = 36
#: Environment variable with the folder of the fork server's socket.
_FOLDER = "ABS_SERVICE_FORK_FOLDER"


def preload(module: str) -> None:
    """Starts the fork server, which forks as soon as it has imported the module.

    Should it die, this process becomes the parent of its children: prctl(2), PR_SET_CHILD_SUBREAPER.
    """
    standard_files.allow_files(FILES)
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    os.environ[_FOLDER] = folder = standard_files.temporary_folder("abs-service-", MAX_PARENT_LENGTH)
    # Of one that multiprocessing makes for itself, it complains when somebody else has deleted it.
    current_process()._config["tempdir"] = folder  # pyright: ignore # noqa: SLF001
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    CONTEXT.set_forkserver_preload([module])
    resource_tracker.ensure_running()  # first, since it unblocks the signal
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))  # by Ctrl-C, the server would end with a traceback
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT,))


def ensure_running() -> None:
    """Starts the fork server anew if it has died, or its folder was deleted, if that can be; its children live on."""
    server: Any = forkserver._forkserver  # pyright: ignore # noqa: SLF001 - nothing public tells its address
    with suppress(OSError):  # else the next start of a process says why
        if standard_files.is_folder_deleted():
            os.chdir("/")  # processes can neither be started nor work in one that was
        os.makedirs(util.get_temp_dir(), 0o700, exist_ok=True)
        if server._forkserver_pid and not os.path.exists(server._forkserver_address):  # noqa: SLF001
            os.kill(server._forkserver_pid, signal.SIGKILL)  # noqa: SLF001
        forkserver.ensure_running()
        # Whoever starts a process waits for it, without an end if somebody has stopped it.
        os.kill(server._forkserver_pid, signal.SIGCONT)  # noqa: SLF001


def give_way() -> None:
    """Lets the kernel end this process, and those that it will fork, before `run` for want of memory."""
    with suppress(OSError):  # the kernel does not offer it
        score = int(_OOM_SCORE_ADJ.read_text(encoding="ascii")) + OOM_SCORE
        _OOM_SCORE_ADJ.write_text(str(min(score, _MAX_OOM_SCORE)), encoding="ascii")


def detach() -> None:
    """Detaches the fork server from the terminal, which is left to `run`.

    It ends when `run` has ended, and removes what `run` cannot if it was killed.
    """
    for number in (signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):  # also of what it forks: who sends them means `run`
        signal.signal(number, signal.SIG_IGN)
    give_way()
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
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT,))  # which the first fork server has inherited
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

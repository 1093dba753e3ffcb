"""The environment that Numba reads: the folder for compiled kernels, without which it keeps none, and threads."""

import atexit
import os
import shutil

import abs_service
from abs_service.supervision.process_setup import standard_files
from calib.jit import THREADS

#: Numba's environment variable for it.
VARIABLE = "NUMBA_CACHE_DIR"
#: The environment variable for the folder of the user in which it keeps them where it cannot beside the code.
USER = "XDG_CACHE_HOME"
#: Largest number of threads of a kernel; with 100,000 a process is killed.
MAX_THREADS = 1000
#: Room for the kernels of a rig, on a disk that is not full [bytes].
MIN_BYTES = 50_000_000


def ensure() -> None:
    """Lets a process and its children keep kernels in a temporary folder if Numba's have no room or are read-only."""
    if not os.path.isabs(os.environ.get(USER, "/")):
        del os.environ[USER]  # as the standard says; Numba would take a folder in the working directory
    given = os.environ.get(VARIABLE)
    if not (_can_be_written(given) if given else _own_folder() or _folders_of_the_code()):
        os.environ[VARIABLE] = folder = standard_files.temporary_folder("abs-service-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)


def check_threads() -> None:
    """Raises StartError if the number of threads is none: each tracker would fail at its first image, for ever."""
    given = os.environ.get(THREADS, "1")
    if not (given.strip().isdecimal() and 1 <= int(given) <= MAX_THREADS):
        raise standard_files.StartError(
            f'the environment variable {THREADS} is "{given}"; allowed: 1 to {MAX_THREADS}, or not set'
        )


def _own_folder() -> bool:
    """True if that of the user can be used."""
    folder = os.environ.get(USER) or os.path.expanduser("~/.cache")
    return os.path.isabs(folder) and _can_be_written(folder)


def _folders_of_the_code() -> bool:
    """True if those beside the code can be used, all of them: root may have made some."""
    code = os.path.dirname(abs_service.__file__)
    if not _can_be_written(code):
        return False
    packages = (os.path.join(os.path.dirname(code), name) for name in ("abs_service", "calib", "drivers"))
    return all(_can_be_written(os.path.join(folder, "__pycache__")) for one in packages for folder, *_ in os.walk(one))


def _can_be_written(folder: str) -> bool:
    while not os.path.exists(folder):
        folder = os.path.dirname(os.path.abspath(folder))
    free = os.statvfs(folder)
    return free.f_bavail * free.f_frsize > MIN_BYTES and os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)

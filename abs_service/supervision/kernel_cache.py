"""The folder in which Numba keeps compiled kernels, without which it compiles none."""

import atexit
import os
import shutil

import abs_service
from abs_service.supervision import standard_files

#: Numba's environment variable for it.
VARIABLE = "NUMBA_CACHE_DIR"
#: Room for the kernels of a rig, on a disk that is not full [bytes].
LEAST_BYTES = 50_000_000


def ensure() -> None:
    """Lets a process and its children keep kernels in a temporary folder if Numba's have no room or are read-only."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    given = os.environ.get(VARIABLE)
    if not any(map(_can_be_written, [given] if given else [os.path.dirname(abs_service.__file__), user])):
        os.environ[VARIABLE] = folder = standard_files.temporary_folder("abs-service-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)


def _can_be_written(folder: str) -> bool:
    while not os.path.exists(folder):
        folder = os.path.dirname(os.path.abspath(folder))
    free = os.statvfs(folder)
    return (
        free.f_bavail * free.f_frsize > LEAST_BYTES and os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)
    )

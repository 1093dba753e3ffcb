"""Standard input, output and error, which a caller may have closed, or given an encoding without our characters.

Nor may a caller's limit of open files be too low, where zenoh would end the process, its working directory be gone, or
its temporary folder be full.
"""

import os
import resource
import sys
import tempfile
from contextlib import suppress

#: Limits of open files: that a process asks for, and the least with which it begins.
FILES, MIN_FILES = 1024, 64

#: The three, by their descriptors, with the mode in which Python opens each.
_FILES = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


class OutputError(Exception):
    """Standard output cannot be written; the message has the reason."""


class StartError(Exception):
    """A process cannot work as it was started: with too few open files, say, or in a folder that was deleted."""


def is_folder_deleted() -> bool:
    """True if the working directory was deleted."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def check_folder() -> None:
    """Raises StartError if the working directory was deleted."""
    if is_folder_deleted():
        raise StartError("the working directory was deleted; change to another one")


def allow_files(wanted: int = FILES) -> None:
    """Raises the limit of open files of this process and its children, if it is lower and can be raised.

    Args:
        wanted: the limit; as much of it as is allowed.

    Raises:
        StartError: it stays below `MIN_FILES`.
    """
    limit, highest = resource.getrlimit(resource.RLIMIT_NOFILE)
    files = wanted if highest == resource.RLIM_INFINITY else min(wanted, highest)
    if limit != resource.RLIM_INFINITY and limit < files:
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, highest))
    if files < MIN_FILES:
        raise StartError(f"the limit of open files is {files}, at least {MIN_FILES} are needed: ulimit -n {FILES}")


def temporary_folder(prefix: str, maximum: int = 4096) -> str:
    """Makes a folder in the temporary one; if that is full, or its path too long, in /tmp or in memory.

    Args:
        prefix: of its name.
        maximum: path of the folder that it is in, at most [bytes].

    Raises:
        StartError: it can be made nowhere.
    """
    parents = ["/tmp", "/dev/shm"]
    with suppress(FileNotFoundError):  # no folder takes the file with which Python tries it
        parents.insert(0, tempfile.gettempdir())
    for parent in parents:
        if len(os.fsencode(parent)) <= maximum:
            with suppress(OSError):
                return tempfile.mkdtemp(prefix=prefix, dir=parent)
    raise StartError(f"no folder can be made in {', '.join(parents)}; make room, or set TMPDIR to another folder")


def secure() -> None:
    """Opens those that are closed on /dev/null, and lets no character be an error.

    A closed one is taken by the next file that is opened: the fork server then closes a pipe of ours, or writes to it.
    """
    for descriptor, (name, mode) in enumerate(_FILES):
        try:
            os.fstat(descriptor)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free, which is this one
            os.set_inheritable(null, True)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, mode, encoding="utf-8", closefd=False))
    sys.stdout.reconfigure(errors="replace")  # pyright: ignore[reportAttributeAccessIssue]


def flush() -> None:
    """Writes what is left of the output.

    Raises:
        BrokenPipeError: its reader is gone.
        OutputError: it cannot be written, as on a full disk.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        discard()
        raise _output_error(error) from None


def blamed(error: Exception) -> Exception:
    """The error that ends a command: OutputError if it was of standard output, else the error itself."""
    # One of standard output has a number and no file; what was printed for others would be in their output.
    if isinstance(error, OSError) and error.errno is not None and error.filename is None:
        try:
            print(flush=True)  # fails again
        except OSError as same:
            discard()
            return _output_error(same)
    return error


def discard() -> None:
    """Lets what is still buffered go nowhere; without this the interpreter would complain about it when it exits."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _output_error(error: OSError) -> OutputError:
    return OutputError(f"standard output cannot be written: {error.strerror}")

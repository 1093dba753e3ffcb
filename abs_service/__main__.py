"""`abs-service`, and `python -m abs_service`: the command line, where Ctrl-C while it is imported is no traceback."""

import os
import signal
import sys


def start() -> None:
    """Runs the command line as a process."""
    if os.getpid() == 1:  # of a container: the kernel does not end it, unless it handles the signal
        signal.signal(signal.SIGTERM, lambda number, _: os._exit(128 + number))
    try:
        from abs_service.cli import program  # noqa: PLC0415 - here, where Ctrl-C is caught

        program()
    except KeyboardInterrupt:
        sys.exit(130)  # `Exit.INTERRUPTED`, which may not be imported yet


if __name__ == "__main__":
    start()

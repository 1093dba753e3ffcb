"""A process that compiles the kernels named on its standard input into the cache, until the input ends."""

import gc
import os
import pickle
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Compiles kernels; answers each request with an error as text, "" if there was none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, whose end closes the input
    answers = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    gc.disable()  # a tenth of the time, for some megabytes of a process that ends soon
    with suppress(EOFError, BrokenPipeError):
        while True:
            os.write(answers, pickle.dumps(_compile(pickle.load(sys.stdin.buffer))))


def _compile(request: bytes) -> str:
    try:
        kernel, types = pickle.loads(request)
        kernel.dispatcher.compile(types)
    except Exception as error:  # whatever it is, the parent meets it again when it compiles the kernel itself
        return repr(error)
    return ""


if __name__ == "__main__":
    main()

"""A process that compiles the kernels that it is told and leaves them in the cache, until its standard input ends."""

import os
import pickle
import signal
import sys


def main() -> None:
    """Compiles; answers each request with an error, or with nothing."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, whose end closes the input
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    while True:
        try:
            request = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(_compile(request), answers)
        answers.flush()


def _compile(request: bytes) -> str:
    try:
        kernel, types = pickle.loads(request)
        kernel.dispatcher.compile(types)
    except Exception as error:  # whatever it is, the parent meets it again when it compiles the kernel itself
        return repr(error)
    return ""


if __name__ == "__main__":
    main()

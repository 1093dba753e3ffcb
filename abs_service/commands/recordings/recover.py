"""Recovers truncated or damaged recordings.

  abs-service recover recordings/x.mcap.active   what a crash left; becomes recordings/x.mcap
  abs-service recover recordings/x.mcap          a damaged file; the result is recordings/x.recovered.mcap
  abs-service recover *.active --out saved       the results go to saved/ and the originals stay

Nothing is thrown away: unless all of a file was saved, it is kept; and no file that is there is overwritten. Exit code
1 if nothing of a file could be saved.
"""

import argparse
import sys
from pathlib import Path

from abs_service.recording.disk import folder
from abs_service.recording.recovery import RecoveryError, recover
from abs_service.supervision.exit_codes import Exit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service recover`."""
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="recordings to recover")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="folder of the results instead of that of the originals"
    )


def run(arguments: argparse.Namespace) -> int:
    """Recovers each file independently and prints numbers of recovered and lost messages; FAILED if one has none."""
    exit_code = Exit.OK
    for path in arguments.files:
        try:
            if arguments.out:
                folder.make(arguments.out)
            report = recover(path, arguments.out)
            print(report)
            exit_code = exit_code if report.messages else max(exit_code, Exit.FAILED)
        except (RecoveryError, OSError) as error:
            reason = error
            if isinstance(error, OSError):
                reason = f"{error.filename or arguments.out or path.parent}: cannot be written: {error.strerror}"
            print(f"abs-service: error: {reason}", file=sys.stderr)
            exit_code = Exit.USER
    return exit_code

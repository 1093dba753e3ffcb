"""Describes recordings: sensors, rates, gaps, losses, how well was tracked, bytes by topic, configuration.

  abs-service info recordings/x.mcap
  abs-service info recordings/*.mcap --json    one JSON object a line, for scripts

Reads the whole file, finished or not. Sizes of topics are before the file's compression.
"""

import argparse
import json
import sys
from pathlib import Path

from abs_service.commands.parts.progress import bars
from abs_service.display.terminal import recording_info
from abs_service.recording.summary import Summary, summarize
from abs_service.supervision.exit_codes import Exit
from drivers.replay.contents import RecordingError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service info`."""
    parser.add_argument("files", metavar="FILE.mcap", nargs="+", type=Path, help="recordings")
    parser.add_argument("--json", action="store_true", help="one JSON object per recording; SI units")


def run(arguments: argparse.Namespace) -> int:
    """Prints a summary of each file, also after one that cannot be read."""
    exit_code = Exit.OK
    for path in arguments.files:
        try:
            summary = _summary(path)
        except RecordingError as error:
            print(f"abs-service: error: {error}", file=sys.stderr)
            exit_code = Exit.USER
            continue
        if arguments.json:
            print(json.dumps(recording_info.values(summary), ensure_ascii=False))
        else:
            recording_info.show(summary)
    return exit_code


def _summary(path: Path) -> Summary:
    with bars() as progress:
        task = progress.add_task(path.name, total=None)
        return summarize(path, lambda done, total: progress.update(task, completed=done, total=total))

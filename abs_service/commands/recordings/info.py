"""Describes recordings: sensors, rates, gaps, losses, how well was tracked, bytes by topic, configuration.

  abs-service info recordings/x.mcap
  abs-service info recordings/*.mcap --json    one JSON object a line, for scripts
  abs-service info recordings/x.mcap --config > rig.toml    the configuration that it was made with

Reads the whole file, finished or not. Sizes of topics are before the file's compression.
"""

import argparse
import json
import sys
from pathlib import Path

from abs_service.commands.parts.progress import bars
from abs_service.display.terminal import recorded_configuration, recording_info
from abs_service.recording.summary import Summary, summarize
from abs_service.supervision.exit_codes import Exit
from drivers.replay.contents import RecordingError, scan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service info`."""
    parser.add_argument("files", metavar="FILE.mcap", nargs="+", type=Path, help="recordings")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="one JSON object per recording; SI units")
    form.add_argument("--config", action="store_true", help="print the configuration it was made with, as TOML")


def run(arguments: argparse.Namespace) -> int:
    """Prints a summary of each file, also after one that cannot be read."""
    exit_code = Exit.OK
    for path in arguments.files:
        try:
            if arguments.config:
                print(_configuration(path), end="")
                continue
            summary = _summary(path)
        except RecordingError as error:
            print(f"abs-service: error: {error}", file=sys.stderr)
            exit_code = Exit.USER
            continue
        if arguments.json:
            print(json.dumps(recording_info.values(summary), ensure_ascii=False, default=str))
        else:
            recording_info.show(summary)
    return exit_code


def _configuration(path: Path) -> str:
    """The configuration in a recording; RecordingError if there is none."""
    found = recorded_configuration.text(scan(path))
    if not found:
        raise RecordingError(f"{path}: no configuration is in this recording")
    return found


def _summary(path: Path) -> Summary:
    with bars() as progress:
        task = progress.add_task(f"{path.name}, chunks", total=None)
        return summarize(path, lambda done, total: progress.update(task, completed=done, total=total))

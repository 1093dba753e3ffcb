"""Copies a recording with its images as they were published, for Foxglove, Rerun and other programs.

  abs-service export recordings/x.mcap                  writes recordings/x_raw.mcap
  abs-service export recordings/x.mcap --out other.mcap

With `record.depth_codec` or `record.color_codec` = "lossless", a recording holds images in fewer bytes, which
abs-service reads and viewers do not.
"""

import argparse
import os
from pathlib import Path

from abs_service.recording.export import ExportError, export
from abs_service.supervision.exit_codes import Exit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service export`."""
    parser.add_argument("recording", metavar="FILE.mcap", type=Path, help="a recording")
    parser.add_argument("--out", metavar="FILE.mcap", type=Path, help="the copy (default: FILE_raw.mcap beside it)")


def run(arguments: argparse.Namespace) -> int:
    """Copies one recording."""
    source: Path = arguments.recording
    path: Path = arguments.out or source.with_name(f"{source.stem}_raw.mcap")
    if path.exists():
        raise ExportError(f"{path} is there already; name another file with --out")
    active = path.with_name(f"{path.name}.active")
    try:
        with active.open("xb") as target:
            count = export(source, target)
        os.replace(active, path)
    except OSError as error:
        raise ExportError(f"{error.filename or path}: {error.strerror}") from None
    finally:
        active.unlink(missing_ok=True)
    print(f"{path}: {count} messages, {path.stat().st_size / 1e6:.1f} MB")
    return Exit.OK

"""The option --picture: one preview picture per tracker."""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from abs_service import config, wiring
from abs_service.commands.parts.options import OptionError, check_folder, picture
from abs_service.display.pictures import preview_picture
from abs_service.tracking.preview import PreviewError, preview
from calib.rig import Rig
from drivers.contract.frame import FrameSet

#: The rig of a tracker, and its frame sets in order of time.
Source = tuple[Rig, Iterable[FrameSet]]


def add_argument(parser: argparse.ArgumentParser) -> None:
    """Adds --picture."""
    parser.add_argument(
        "--picture",
        metavar="PATH",
        type=picture,
        help="picture to draw of what would be tracked in the first frame; of several trackers, PATH-NAME each",
    )


def draw(settings: config.ServiceConfig, name: str, path: Path, source: Source) -> str:
    """Draws one tracker's preview and returns a line about the file; why it finds no object goes to standard error.

    Raises:
        OptionError: there is no depth image, or the file cannot be written.
    """
    own = path if len(settings.trackers) == 1 else path.with_name(f"{path.stem}-{name}{path.suffix}")
    check_folder(own, "--picture")
    try:
        seen = preview(source[1], source[0], wiring.plan(settings, name))
        preview_picture.draw(seen, name, wiring.model_name(settings, name), own)
    except PreviewError as error:
        raise OptionError(f"--picture {own}: {error}") from None
    except OSError as error:
        raise OptionError(f"--picture {own}: cannot be written: {error.strerror}") from None
    if seen.found is None:
        print(f"abs-service: note: {name} finds nothing to track: {seen.reason}", file=sys.stderr)
    for doubt in seen.warnings:
        print(f"abs-service: note: {name}: {doubt}", file=sys.stderr)
    numbers = ", ".join(f"{key} = {_toml(values)}" for key, values in seen.derived.items())
    return f"wrote {own}" + (f"; {name} has {numbers}" if numbers else "")


def _toml(numbers: tuple[float, ...]) -> str:
    one, *others = (f"{number:g}" for number in numbers)
    return f"[{', '.join((one, *others))}]" if others else one

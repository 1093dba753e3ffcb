"""Bending stiffness of a strip that hangs from a gripper: tracks a recording, fits the heavy elastica, draws both.

  abs-service stiffness recordings/x.mcap --weight 0.08               paper of 80 g/m²
  abs-service stiffness recordings/x.mcap --weight 0.08 --plot p.svg  choose the picture
  abs-service stiffness recordings/x.mcap --weight 0.08 --json        one JSON object, for scripts

The tracker's model has to be "gravity" (docs/explanation/gravity.md), in the recording's configuration or in that of
--config.
"""

import argparse
import json
import sys
from pathlib import Path

from abs_service import config, wiring
from abs_service.commands.parts import progress, recorded_rig
from abs_service.commands.parts.options import OptionError, check_folder, picture, positive
from abs_service.commands.recordings import replay
from abs_service.display.pictures.stiffness_plot import draw
from abs_service.supervision.exit_codes import Exit
from abs_service.tracker.models import gravity
from abs_service.tracking.bending_stiffness.hanging_strip import HangingStrip, track_strip
from abs_service.tracking.bending_stiffness.stiffness import Stiffness, estimate_stiffness
from drivers.replay import Recording

#: Standard gravity [m/s²].
FREE_FALL = 9.80665


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service stiffness`."""
    parser.add_argument("recording", metavar="FILE", type=Path, help="recording to track")
    parser.add_argument("--weight", metavar="KG_M2", type=positive, required=True, help="mass of the strip per area")
    parser.add_argument("--config", metavar="RIG", type=Path, help="TOML file (default: the one in the recording)")
    parser.add_argument("--tracker", metavar="NAME", help="tracker (default: the one with a gravity model)")
    parser.add_argument("--plot", metavar="PATH", type=picture, help="picture to draw (default: FILE-stiffness.png)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Estimates, prints and draws."""
    path = arguments.recording
    plot = arguments.plot or path.with_name(f"{path.stem}-stiffness.png")
    check_folder(plot, "--plot" if arguments.plot else "")
    recording = Recording(path)
    for note in replay.notes(recording):
        print(f"abs-service: note: {note}", file=sys.stderr)
    settings = replay.configuration(recording, arguments.config)
    name = _tracker(settings, arguments.tracker, path)
    strip = _track(recording, settings, name, arguments.json)
    model = strip.model
    seen = model.strip
    found = estimate_stiffness(strip.inclinations, seen.length, seen.length_deviation, seen.load_deviation)
    bending = found.bending(arguments.weight * FREE_FALL, seen.length)
    title = f"D = {bending * 1e3:.3g} mN·m ± {found.deviation:.0%}, {found.frames} frames"
    try:
        draw(strip.profiles(found), title, plot)
    except OSError as error:
        raise OptionError(f"--plot {plot}: {error.strerror}") from error
    lines = _json(found, bending, strip, plot) if arguments.json else _text(found, bending, strip, plot)
    print(lines)
    return Exit.OK


def _track(recording: Recording, settings: config.ServiceConfig, name: str, as_json: bool) -> HangingStrip:
    rig, synchroniser = recorded_rig.recorded_rig(settings, name, recording)
    plan = wiring.plan(settings, name)
    with progress.bars(disable=as_json) as bars:
        task = bars.add_task("images", total=sum(recording.counts.values()))
        return track_strip(recording, rig, synchroniser, plan, lambda: bars.advance(task))


def _tracker(settings: config.ServiceConfig, wanted: str | None, path: Path) -> str:
    """The tracker with a gravity model."""
    able = [name for name, table in settings.trackers.items() if isinstance(table.model, gravity.Settings)]
    if wanted is not None and wanted not in able:
        raise OptionError(f"--tracker {wanted}: must be a tracker with a gravity model, one of {able}")
    if not able:
        raise OptionError(
            f"{path}: no tracker has a gravity model; name a configuration that has one with --config, "
            f'in which model = {{ type = "gravity" }}'
        )
    return wanted or able[0]


def _text(found: Stiffness, bending: float, strip: HangingStrip, plot: Path) -> str:
    size = strip.model.strip
    return "\n".join(
        [
            f"strip {size.length * 1e3:.0f} × {size.width * 1e3:.0f} mm, {strip.model.segments} segments, "
            f"{found.frames} frames tracked, {strip.untracked} not",
            f"bending stiffness per width  D = {bending * 1e3:.4g} mN·m ± {found.deviation:.1%} (one deviation)",
            f"  of the whole strip        EI = {bending * size.width:.4g} N·m²",
            f"  from the scatter {found.scatter:.1%}, from where the strip's ends are {found.from_length:.1%}, "
            f"from its shape when it was found {found.from_first:.1%}",
            f"load w L³/D {found.load:.3g}; squared residuals {found.misfit:.1f} of their variance"
            + (": the strip is not straight by itself, not uniform, or moves fast" if found.misfit > 9 else ""),
            f"drew {plot}",
        ]
    )


def _json(found: Stiffness, bending: float, strip: HangingStrip, plot: Path) -> str:
    size = strip.model.strip
    return json.dumps(
        {
            "bending_stiffness_per_width_nm": bending,
            "relative_deviation": found.deviation,
            "relative_deviation_scatter": found.scatter,
            "relative_deviation_length": found.from_length,
            "relative_deviation_first": found.from_first,
            "bending_stiffness_nm2": bending * size.width,
            "load": found.load,
            "misfit": found.misfit,
            "frames": found.frames,
            "frames_untracked": strip.untracked,
            "length_m": size.length,
            "width_m": size.width,
            "plot": str(plot),
        }
    )

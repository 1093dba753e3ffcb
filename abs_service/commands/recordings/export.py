"""Writes a recording in the format of another program, chosen by the suffix of --out.

  abs-service export recordings/x.mcap                         x_view.mcap, for Foxglove and Lichtblick
  abs-service export recordings/x.mcap --out x.rrd             the same for Rerun
  abs-service export recordings/x.mcap --out x.csv             Θ, σ and status, one row for each estimate; or .parquet
  abs-service export recordings/x.mcap --out x.npz             times, Θ, vertices, covariances, faces for NumPy
  abs-service export recordings/x.mcap --out meshes/sheet.ply  one mesh for each estimate, or .obj
  abs-service export recordings/x.mcap --out x.glb             the mesh as an animation
  abs-service export recordings/x.mcap --out x.mp4             the images as a film, with the mesh drawn over them

A copy for viewers has depth in metres along the optical axis, meshes as foxglove.SceneUpdate and points as
foxglove.PointCloud; images of every codec become raw ones. To track again, `replay` the recording itself.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path

from abs_service.api.checks import ArgumentError
from abs_service.api.estimate import Estimate
from abs_service.api.recording import Recording
from abs_service.bus import keys
from abs_service.commands.parts.options import check_new, ending_in, number
from abs_service.commands.parts.progress import bars
from abs_service.export import animation, arrays, series, table, viewers
from abs_service.export.errors import ExportError
from abs_service.supervision.exit_codes import Exit
from abs_service.wire.estimate_messages import STATE
from drivers.contract.errors import install_extra
from drivers.replay.contents import scan

#: Rate of the meshes and points for viewers [Hz].
VIEW_HZ = 5.0

_Writer = Callable[[Iterable[Estimate], Path], int]

_WRITERS: Mapping[str, _Writer] = {
    ".csv": table.write,
    ".npz": arrays.write,
    ".glb": animation.write,
    ".obj": series.write,
    ".ply": series.write,
}
#: Formats that need another package: it, and the extra that has it.
_EXTRAS = {".parquet": ("pyarrow", "parquet"), ".mp4": ("av", "import"), ".rrd": ("rerun", "rerun")}

#: Formats of several files, whose folder is the output.
_SERIES = (".obj", ".ply")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service export`."""
    parser.add_argument("recording", metavar="FILE.mcap", type=Path, help="a recording, or what `replay` wrote")
    parser.add_argument(
        "--out",
        metavar="PATH",
        type=ending_in(".mcap", *_WRITERS, *_EXTRAS),
        help="what to write (default: FILE_view.mcap beside it)",
    )
    parser.add_argument("--tracker", metavar="NAME", default="", help="whose estimates, if there are several")
    parser.add_argument(
        "--view-hz",
        metavar="HZ",
        type=number(0, 1000, "a rate from 0 to 1000 Hz"),
        default=VIEW_HZ,
        help=f"largest rate of meshes and points for viewers (default: {VIEW_HZ:g}; 0: none)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Exports one recording."""
    source: Path = arguments.recording
    path: Path = arguments.out or source.parent / f"{source.stem}_view.mcap"
    package, extra = _EXTRAS.get(path.suffix, ("", ""))
    if package and find_spec(package) is None:
        raise ExportError(f"--out {path} needs {package}: {install_extra(extra)} in the clone")
    try:
        if path.suffix in _SERIES:
            done = _write_estimates(source, arguments.tracker, path.suffix, path)
            print(f"{path.with_name(path.stem)}_*{path.suffix}: {done}")
            return Exit.OK
        active = check_new(path, "--out" if arguments.out else "")
        try:
            if path.suffix == ".mcap":
                done = _write_view(source, arguments.view_hz, active)
            elif path.suffix == ".rrd":
                done = _write_rerun(source, arguments.tracker, arguments.view_hz, active)
            else:
                done = _write_estimates(source, arguments.tracker, path.suffix, active)
            os.replace(active, path)
        finally:
            active.unlink(missing_ok=True)
    except OSError as error:
        raise ExportError(f"{str(error.filename or path).removesuffix('.active')}: {error.strerror}") from None
    print(f"{path}: {done}, {path.stat().st_size / 1e6:.1f} MB")
    return Exit.OK


def _write_view(source: Path, view_hz: float, path: Path) -> str:
    contents = scan(source)
    total = sum(topic.count for topic in contents.topics.values())
    with path.open("xb") as target, bars() as progress:
        task = progress.add_task("messages", total=total)
        written, notes = viewers.export(source, contents, target, view_hz, lambda: progress.advance(task))
    for note in notes:
        print(f"abs-service: note: {note}", file=sys.stderr)
    return f"{written} messages"


def _write_rerun(source: Path, tracker: str, view_hz: float, path: Path) -> str:
    from abs_service.export import rerun_file  # noqa: PLC0415 - needs rerun-sdk

    recording = _recording(source)
    names = (tracker,) if tracker else recording.trackers
    estimates = {name: _estimates(recording, name) for name in names}
    states = {f"/{keys.state(name)}" for name in names}
    total = sum(one.count for one in scan(source).topics.values() if one.name.endswith("/image") or one.name in states)
    with bars() as progress:
        task = progress.add_task("images and estimates", total=total)
        written, notes = rerun_file.write(recording, estimates, path, view_hz, lambda: progress.advance(task))
    for note in notes:
        print(f"abs-service: note: {note}", file=sys.stderr)
    return f"{written} images and estimates"


def _write_estimates(source: Path, tracker: str, suffix: str, path: Path) -> str:
    recording = _recording(source)
    estimates = _estimates(recording, tracker)
    name = tracker or recording.trackers[0]
    counts = {topic.name.split("/")[1]: topic.count for topic in scan(source).topics.values() if topic.schema == STATE}
    with bars() as progress:
        tracked = progress.track(estimates, counts[name], description="estimates")
        written = _writer(suffix, recording)(tracked, path)
    return (
        f"{written} estimates of {name}"
        if written == counts[name]
        else f"{written} of {counts[name]} estimates of {name}"
    )


def _writer(suffix: str, recording: Recording) -> _Writer:
    if suffix == ".parquet":
        from abs_service.export import parquet  # noqa: PLC0415 - needs pyarrow

        return parquet.write
    if suffix == ".mp4":
        from abs_service.export import film  # noqa: PLC0415 - needs PyAV

        return lambda estimates, path: film.write(estimates, recording, path)
    return _WRITERS[suffix]


def _recording(source: Path) -> Recording:
    recording = Recording(source)
    if recording.truncated:
        print(
            f"abs-service: note: {source} was never finished; what follows is up to where it breaks off",
            file=sys.stderr,
        )
    return recording


def _estimates(recording: Recording, tracker: str) -> Iterable[Estimate]:
    try:
        return recording.estimates(tracker)
    except ArgumentError as error:
        raise ExportError(str(error)) from None

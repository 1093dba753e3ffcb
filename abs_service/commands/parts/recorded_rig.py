"""The rig of a tracker, with the cameras and images of a recording."""

from pathlib import Path

from abs_service import config, wiring
from abs_service.commands.parts import preview_option
from abs_service.commands.parts.options import OptionError
from abs_service.config.problems import allowed_instead
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracking.observer import missing_streams
from calib.rig import Rig
from drivers.replay import Recording


def recorded_rig(settings: config.ServiceConfig, name: str, recording: Recording) -> tuple[Rig, Synchroniser]:
    """The rig of one tracker with the cameras of the recording, and its synchroniser of frame sets.

    Raises:
        OptionError: the recording lacks images that the tracker needs.
    """
    there = sorted({sensor for sensor, _ in recording.counts})
    unknown = [sensor for sensor in settings.trackers[name].sensors if sensor not in there]
    if unknown:
        raise OptionError(
            f'{recording.path}: tracker "{name}" needs sensor "{unknown[0]}", which is not there; '
            f"the recording has: {', '.join(there)}"
        )
    cameras = wiring.cameras(settings, recording.cameras)
    if lacking := [sensor for sensor in settings.trackers[name].sensors if sensor not in cameras]:
        raise OptionError(
            f'{recording.path}: no camera of sensor "{lacking[0]}" is in this recording; '
            f"describe it in sensors.{lacking[0]}.camera of a rig file for --config"
        )
    rig = wiring.rig(settings, name, cameras)
    there = [f"{sensor}/{stream}" for sensor, stream in recording.counts]
    if missing := missing_streams(rig.sensors.values(), there):
        raise OptionError(f'{recording.path}: tracker "{name}" needs {", ".join(missing)}, which is not there')
    if (reference := "/".join(settings.reference(name))) not in there:
        message = f'tracker "{name}" is paced by {reference}, which is not there; {allowed_instead(reference, there)}'
        raise OptionError(f"{recording.path}: {message}")
    return rig, wiring.synchroniser(settings, name, rig.sensors.values())


def draw_previews(settings: config.ServiceConfig, recording: Recording, path: Path) -> list[str]:
    """Draws a preview of each tracker; returns a line about each picture."""
    lines: list[str] = []
    for name in settings.trackers:
        rig, synchroniser = recorded_rig(settings, name, recording)
        frame_sets = synchroniser.group(recording.images())
        lines.append(preview_option.draw(settings, name, path, (rig, frame_sets)))
    return lines

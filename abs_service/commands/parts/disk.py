"""The disk of a rig's recordings."""

import math
import shutil

from abs_service import config
from abs_service.recording.disk import forecast
from abs_service.recording.disk.retention import Retention
from abs_service.recording.recording_file import ESTIMATES


def recordings(rig: config.ServiceConfig) -> Retention:
    """Limits of age and size of the recordings."""
    table = rig.record
    retained = table.retain_s or math.inf, table.retain_bytes or math.inf
    return Retention(table.directory, rig.name, "", *retained, table.rotate_s, table.rotate_bytes)


def estimates(rig: config.ServiceConfig) -> Retention:
    """Limits of age and size of the files that hold estimates only."""
    table = rig.record
    limits = table.retain_estimates_s or math.inf, table.retain_estimates_bytes or math.inf
    return Retention(table.directory, rig.name, ESTIMATES, *limits)


def lasts(rig: config.ServiceConfig, rate: float) -> str:
    """Time until the disk is full at a recording rate [bytes/s], without estimates, in words; see `forecast.text`."""
    directory = rig.record.directory
    folder = next(path for path in (directory, *directory.parents) if path.is_dir())
    room = shutil.disk_usage(folder).free - rig.record.minimum_free_bytes
    return forecast.text(recordings(rig).growth(rate), estimates(rig).growth(0.0), room)

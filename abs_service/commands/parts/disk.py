"""The disk of a rig's recordings."""

import math
import shutil

from abs_service import config
from abs_service.recording import forecast
from abs_service.recording.retention import Retention


def retention(rig: config.ServiceConfig) -> Retention:
    """What is kept of the recordings."""
    table = rig.record
    return Retention(table.directory, rig.name, table.retain_s or math.inf, table.retain_bytes or math.inf)


def lasts(rig: config.ServiceConfig, rate: float) -> str:
    """How long the disk lasts at a rate of recording [bytes/s], see `forecast.text`."""
    kept = retention(rig)
    folder = next(path for path in (kept.directory, *kept.directory.parents) if path.is_dir())
    room = shutil.disk_usage(folder).free - rig.record.minimum_free_bytes
    used = sum(file.size for file in kept.files())
    return forecast.text(rate, room, used, kept.retain_s, kept.retain_bytes)

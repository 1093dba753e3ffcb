"""Playback of recordings by depthai: same queues and messages as from a device, without one attached."""

import threading
from collections.abc import Mapping
from pathlib import Path

from drivers.contract.clock import Stamp
from drivers.contract.device import AddressError, DeviceInfo
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.oak import library
from drivers.oak.address import Address
from drivers.oak.eeprom import EepromError
from drivers.oak.images import recording
from drivers.oak.images.messages import OutputQueue
from drivers.oak.roles import Role
from drivers.oak.source.connection import Connection

#: Depth of the image queues; the newest images are kept.
_QUEUE = 4
#: Maximum lag between streams [exposures].
_REMEMBERED = 64


def connect(address: Address, path: Path) -> Connection:
    """Starts playback of a recording in real time.

    Raises:
        AddressError: the recording cannot be played.
        SdkMissingError: depthai is not installed.
        DeviceError: an error of depthai.
    """
    try:
        files: Mapping[Path, Role] = recording.files(path)
        poses, rate_hz = recording.poses(path), recording.rate_hz(path)
    except (ForeignRecordingError, EepromError) as error:
        raise AddressError(f"{address.uri}: {error}") from error
    dai = library.load()
    with library.translated_errors(address.uri):
        pipeline = dai.Pipeline(False)
        queues = {}
        for file, role in files.items():
            node = pipeline.create(dai.node.ReplayMetadataOnly)
            node.setReplayFile(file)
            node.setLoop(address.loop)
            queues[role] = OutputQueue(node.out.createOutputQueue(maxSize=_QUEUE, blocking=False))
        pipeline.start()
    info = DeviceInfo(uri=address.uri, model="OAK recording", serial=path.name)
    clock = PlaybackClock()
    return Connection(info, queues, poses, rate_hz, pipeline.stop, lambda: clock, ended="the recording has ended")


class PlaybackClock:
    """Host times of a playback: frames of one exposure get one host time, also if streams lag.

    depthai plays a few per cent too slowly and each stream independently, so `DeviceClock` does not apply.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._played: dict[int, int] = {}  # host times of the latest exposures, by device time

    @property
    def gauges(self) -> Mapping[str, float]:
        """Empty: there is no device clock."""
        return {}

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """Host time of device time `ticks` [ns]."""
        with self._lock:
            newest = max(self._played, default=ticks)
            if ticks not in self._played:
                late = ticks < newest
                self._played[ticks] = ticks + self._played[newest] - newest if late else t_arrival_ns
                self._played = dict(sorted(self._played.items())[-_REMEMBERED:])
            return Stamp(self._played.get(ticks, t_arrival_ns), 0, False)

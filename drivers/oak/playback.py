"""A recording played by depthai itself: the same queues and messages as from a device, with none attached."""

import threading
from collections.abc import Mapping
from pathlib import Path

from drivers.contract.clock import Stamp
from drivers.contract.device import AddressError, DeviceInfo
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.oak import library, recording
from drivers.oak.address import Address
from drivers.oak.connection import Connection
from drivers.oak.eeprom import EepromError
from drivers.oak.messages import OutputQueue
from drivers.oak.roles import Role

#: Newest images that wait; the pump takes them at once.
_QUEUE = 4
#: So many exposures one stream may lag behind another.
_REMEMBERED = 64


def connect(address: Address, path: Path) -> Connection:
    """Starts to play a recording at its own clock.

    Raises:
        AddressError: it cannot be played.
        SdkMissingError: depthai is not installed.
        DeviceError: depthai refuses.
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
    """Host times of what is played: those of the exposure that was played last, wherever its streams have got to.

    depthai plays a few per cent too slowly and each stream by itself, which no clock would do.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._played: dict[int, int] = {}  # host time of the latest device times

    @property
    def gauges(self) -> Mapping[str, float]:
        """Nothing: this is no clock."""
        return {}

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """The host time of device time `ticks` [ns]."""
        with self._lock:
            newest = max(self._played, default=ticks)
            if ticks not in self._played:
                late = ticks < newest
                self._played[ticks] = ticks + self._played[newest] - newest if late else t_arrival_ns
                self._played = dict(sorted(self._played.items())[-_REMEMBERED:])
            return Stamp(self._played.get(ticks, t_arrival_ns), 0, False)

"""Reads messages of ROS 2 bags by `rosbags`, without ROS."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.encoding.rosbag_errors import rosbag_errors


@dataclass(frozen=True, slots=True)
class Message:
    """One message: topic, time at which it was recorded (wall clock) [ns], and content with ROS's field names."""

    topic: str
    time_ns: int
    content: Any


@dataclass(frozen=True, slots=True)
class Topic:
    """Type and number of the messages of a topic."""

    type: str
    count: int


class Bag:
    """A bag: the folder that `ros2 bag record` makes, or one of the MCAP or SQLite files in it."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def topics(self) -> Mapping[str, Topic]:
        """All topics.

        Raises:
            ForeignRecordingError: the bag cannot be read, or `rosbags` is not installed.
        """
        with self._reader() as reader:
            return {name: Topic(one.msgtype or "", one.msgcount) for name, one in reader.topics.items()}

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Messages of topics in order of recording.

        Raises:
            ForeignRecordingError: as `topics`, and for a corrupt message.
        """
        with self._reader() as reader:
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415  an extra

            # Definitions in the bag are not read: SQLite files of older releases have none, MCAP files have those of
            # services as well, on which rosbags fails; and the types that are used here are the same in all releases.
            types = get_typestore(Stores.ROS2_HUMBLE)
            wanted = [one for one in reader.connections if one.topic in topics]
            # An empty list would select all connections.
            for connection, time_ns, data in reader.messages(wanted) if wanted else ():
                yield Message(connection.topic, time_ns, types.deserialize_cdr(data, connection.msgtype))

    @contextmanager
    def _reader(self) -> Iterator[Any]:
        """Opens the bag; translates exceptions into errors that name the file and the remedy."""
        with rosbag_errors(self._path, "ROS 2"):
            from rosbags.rosbag2 import Reader  # noqa: PLC0415  an extra

            with Reader(self._path) as reader:
                yield reader

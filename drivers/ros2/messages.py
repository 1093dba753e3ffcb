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
            wanted = [one for one in reader.connections if one.topic in topics]
            # An empty list would select all connections.
            for connection, time_ns, data in reader.messages(wanted) if wanted else ():
                yield Message(connection.topic, time_ns, reader.deserialize(data, connection.msgtype))

    @contextmanager
    def _reader(self) -> Iterator[Any]:
        """Opens the bag; translates exceptions into errors that name the file and the remedy."""
        with rosbag_errors(self._path, "ROS 2"):
            from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

            # SQLite files of older releases do not describe their messages; those used here are the same in all.
            with AnyReader([self._path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
                yield reader

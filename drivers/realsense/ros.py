"""Reads messages of ROS 1 bags by `rosbags`, without ROS."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.encoding.rosbag_errors import rosbag_errors


@dataclass(frozen=True, slots=True)
class Message:
    """One message: topic, time since the start of the recording [ns], and content with ROS's field names."""

    topic: str
    time_ns: int
    content: Any


class Bag:
    """A ROS 1 bag."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def counts(self) -> Mapping[str, int]:
        """Number of messages by topic.

        Raises:
            ForeignRecordingError: the file cannot be read, or `rosbags` is not installed.
        """
        with rosbag_errors(self._path, "ROS 1"):
            from rosbags.rosbag1 import Reader  # noqa: PLC0415  an extra

            with Reader(self._path) as reader:
                return {connection.topic: connection.msgcount for connection in reader.connections}

    def messages(self, topics: str) -> Iterator[Message]:
        """Messages of topics that fully match a regular expression, in order of time.

        Raises:
            ForeignRecordingError: as `counts`, and for a corrupt message.
        """
        with rosbag_errors(self._path, "ROS 1"):
            from rosbags.rosbag1 import Reader  # noqa: PLC0415  an extra
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

            types = get_typestore(Stores.ROS1_NOETIC)
            with Reader(self._path) as reader:
                wanted = [connection for connection in reader.connections if re.fullmatch(topics, connection.topic)]
                # An empty list would select all connections.
                for connection, time_ns, data in reader.messages(wanted) if wanted else ():
                    content = types.deserialize_ros1(data, connection.msgtype)
                    yield Message(connection.topic, time_ns, content)

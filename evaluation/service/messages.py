"""Messages of the finished recordings of a folder, as they were written."""

from collections.abc import Collection, Iterator
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Message


def recorded_messages(folder: Path, topics: Collection[str], suffix: str = "") -> Iterator[tuple[str, Message]]:
    """Topic and message of everything that was recorded of some topics, file by file in the order of writing.

    Args:
        folder: with the recordings of one run; a long one is in several files.
        topics: as on the bus, such as `tof/depth/image`.
        suffix: how the names of the files end, before `.mcap`.
    """
    for path in sorted(folder.glob(f"*{suffix}.mcap")):
        with path.open("rb") as stream:
            # In the order of the file: sorting by time would keep whole chunks of images in memory.
            messages = make_reader(stream).iter_messages([f"/{topic}" for topic in topics], log_time_order=False)
            for _, channel, message in messages:
                yield channel.topic.removeprefix("/"), message

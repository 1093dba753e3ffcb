"""What a recording holds of some topics: the senders' numbers, so that every hole shows."""

from collections.abc import Collection, Mapping
from pathlib import Path

from mcap.reader import make_reader


def numbers(folder: Path, topics: Collection[str]) -> Mapping[str, frozenset[int]]:
    """The numbers of all messages of some topics in the finished recordings of a folder.

    Args:
        folder: with the recordings of one run; a long one is in several files.
        topics: as on the bus, such as `tof/depth/image`.
    """
    found: dict[str, set[int]] = {topic: set() for topic in topics}
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as stream:
            # In the order of the file: sorting by time would keep whole chunks of images in memory.
            messages = make_reader(stream).iter_messages([f"/{topic}" for topic in topics], log_time_order=False)
            for _, channel, message in messages:
                found[channel.topic.removeprefix("/")].add(message.sequence)
    return {topic: frozenset(seqs) for topic, seqs in found.items()}


def holes(seqs: Collection[int], first: int, last: int) -> int:
    """How many of the numbers from `first` to `last` are not among `seqs`."""
    return len(set(range(first, last + 1)).difference(seqs))

"""Sequence numbers of recorded messages, for counting missing ones."""

from collections.abc import Collection, Mapping
from pathlib import Path

from mcap.reader import make_reader


def sequence_numbers(folder: Path, topics: Collection[str]) -> Mapping[str, frozenset[int]]:
    """Sequence numbers of all messages of some topics in the finished recordings of a folder.

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


def count_missing(seqs: Collection[int], first: int, last: int) -> int:
    """Number of the sequence numbers from `first` to `last` that are missing in `seqs`."""
    return len(set(range(first, last + 1)).difference(seqs))

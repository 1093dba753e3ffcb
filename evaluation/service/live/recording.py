"""Sequence numbers of recorded messages, for counting missing ones."""

from collections.abc import Collection, Mapping
from pathlib import Path

from evaluation.service.messages import recorded_messages


def sequence_numbers(folder: Path, topics: Collection[str]) -> Mapping[str, frozenset[int]]:
    """Sequence numbers of all messages of some topics in the finished recordings of a folder.

    Args:
        folder: with the recordings of one run; a long one is in several files.
        topics: as on the bus, such as `tof/depth/image`.
    """
    found: dict[str, set[int]] = {topic: set() for topic in topics}
    for topic, message in recorded_messages(folder, topics):
        found[topic].add(message.sequence)
    return {topic: frozenset(seqs) for topic, seqs in found.items()}


def count_missing(seqs: Collection[int], first: int, last: int) -> int:
    """Number of the sequence numbers from `first` to `last` that are missing in `seqs`."""
    return len(set(range(first, last + 1)).difference(seqs))

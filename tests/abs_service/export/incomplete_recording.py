"""A recording with estimates in which something else is missing."""

from pathlib import Path

from mcap.reader import make_reader

from drivers.encoding.mcap_file import McapFile
from tests.abs_service.commands.recordings.estimated_recording import write_estimated


def write_without(folder: Path, part: str) -> Path:
    """Writes a recording without the topics that end in `part`: `image`, as `abs-service replay` does, or `model`."""
    path = folder / "incomplete.mcap"
    with write_estimated(folder / "all.mcap").open("rb") as source, path.open("wb") as target:
        file = McapFile(target)
        for schema, channel, message in make_reader(source).iter_messages():
            if not channel.topic.endswith(f"/{part}") and schema is not None:
                file.write(channel.topic, schema.name, message.data, message.log_time, message.sequence)
        file.finish()
    return path

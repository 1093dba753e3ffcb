"""A recording of estimates only, as `abs-service replay` writes it."""

from pathlib import Path

from mcap.reader import make_reader

from drivers.encoding.mcap_file import McapFile
from tests.abs_service.commands.estimated_recording import write_estimated


def write_without_images(folder: Path) -> Path:
    """Writes it into a folder."""
    path = folder / "estimates.mcap"
    with write_estimated(folder / "all.mcap").open("rb") as source, path.open("wb") as target:
        file = McapFile(target)
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic.startswith("/sheet/") and schema is not None:
                file.write(channel.topic, schema.name, message.data, message.log_time, message.sequence)
        file.finish()
    return path

"""Settings of the recorder."""

from dataclasses import dataclass
from pathlib import Path

from drivers.encoding.encoded_image import ImageEncoder, unchanged
from drivers.encoding.mcap_file import CHUNK_SIZE, Compression


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """Settings of the recorder.

    Attributes:
        directory: where the files go; made when it does not exist.
        name: beginning of their names.
        rig_toml: effective configuration, attached to every file.
        encode_image: makes the recorded message of an image.
        compression, chunk_bytes: of the MCAP chunks.
        flush_s: longest time until a message is on disk, and so the most that a crash can lose.
        rotate_bytes, rotate_s: size and age at which a new file begins.
        minimum_free_bytes: free space at which recording ends.
        estimates: whether estimates are written to a file of their own as well.
        pre_roll_s, pre_roll_bytes: what is held of the time before a trigger; the oldest beyond the bytes are
            dropped and counted.
        queue_bytes: messages that may wait for a slow disk; more are dropped and counted.
    """

    directory: Path
    name: str
    rig_toml: str
    encode_image: ImageEncoder = unchanged
    compression: Compression = Compression.LZ4
    chunk_bytes: int = CHUNK_SIZE
    flush_s: float = 1.0
    rotate_bytes: int = 4_000_000_000
    rotate_s: float = 3600.0
    minimum_free_bytes: int = 1_000_000_000
    estimates: bool = False
    pre_roll_s: float = 0.0
    pre_roll_bytes: int = 0
    queue_bytes: int = 256 << 20

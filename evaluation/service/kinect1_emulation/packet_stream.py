"""Precomputed packet streams of emulated cameras."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from drivers.kinect1.transport.packets import HEADER_BYTES, PACKET_BYTES, PacketFormat

#: Microframes per second, and images per second of all formats that are emulated.
MICROFRAMES_HZ, RATE_HZ = 8000, 30


class PacketStream:
    """Images as packets in USB microframes, repeated cyclically by default.

    Image i begins in microframe ⌈i · 8000 / 30⌉, with one packet per microframe until it is complete.

    Args:
        form: packet format.
        images: packed images.
        lost: fraction of lost packets, see `lose`.
    """

    def __init__(self, form: PacketFormat, images: Sequence[bytes], lost: float = 0.0) -> None:
        self.form = form
        self.images = images
        self._packets = np.stack([_cut(form, image) for image in images])
        self._lengths = np.full(form.packets, HEADER_BYTES + form.payload, np.uint32)
        self._lengths[-1] = HEADER_BYTES + form.image_bytes - (form.packets - 1) * form.payload
        self._image = lambda number: number % len(images)
        self.lose(lost)

    def lose(self, share: float) -> None:
        """Sets the fraction of lost packets; the selection depends on the microframe only."""
        self._lost = np.random.default_rng(1).random(80021) < share

    def microframes(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Packets (count, PACKET_BYTES) of `count` microframes, and their lengths."""
        u = np.arange(first, first + count)
        number = u * RATE_HZ // MICROFRAMES_HZ
        place = u - begin(number)
        used = (place < self.form.packets) & ~self._lost[u % len(self._lost)]
        packets = np.zeros((count, PACKET_BYTES), np.uint8)
        lengths = np.where(used, self._lengths[np.minimum(place, self.form.packets - 1)], 0).astype(np.uint32)
        number, place = number[used], place[used]
        packets[used] = self._packets[self._image(number), place]
        packets[used, 5] = number * self.form.packets + place
        packets[used, 8:12] = (number * self.form.period_ticks).astype("<u4")[:, None].view(np.uint8)
        return packets, lengths

    def shown(self, number: int) -> bytes:
        """The image with a number."""
        return self.images[self._image(number)]

    def play(self, start: int, repeat: int) -> None:
        """Plays the images once from image number `start` on, each `repeat` times; before, the first one."""
        self._image = lambda number: np.clip((number - start) // repeat, 0, len(self.images) - 1)

    def is_whole(self, number: int) -> bool:
        """True if no packet of the image is lost."""
        return not self._lost[(begin(number) + np.arange(self.form.packets)) % len(self._lost)].any()


Number = TypeVar("Number", int, np.ndarray)


def begin(number: Number) -> Number:
    """First microframe of an image."""
    return -(-number * MICROFRAMES_HZ // RATE_HZ)


def images_of(first: int, end: int) -> range:
    """Numbers of the images in microframes from `first` to before `end`."""
    return (
        range(first * RATE_HZ // MICROFRAMES_HZ, (end - 1) * RATE_HZ // MICROFRAMES_HZ + 1) if end > first else range(0)
    )


def _cut(form: PacketFormat, image: bytes) -> np.ndarray:
    """Packets (packets, PACKET_BYTES) of one image, without its number and time."""
    assert len(image) == form.image_bytes
    padded = np.zeros(form.packets * form.payload, np.uint8)
    padded[: len(image)] = np.frombuffer(image, np.uint8)
    packets = np.zeros((form.packets, PACKET_BYTES), np.uint8)
    packets[:, :2] = np.frombuffer(b"RB", np.uint8)
    packets[:, 3] = form.base | 2
    packets[0, 3], packets[-1, 3] = form.base | 1, form.base | 5
    packets[:, HEADER_BYTES : HEADER_BYTES + form.payload] = padded.reshape(form.packets, form.payload)
    return packets

"""Assembly of images from packets; incomplete images are dropped and counted.

Gaps of a few packets can be bridged instead; they are marked in the image.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel
from drivers.kinect1.transport.packets import HEADER_BYTES, PacketFormat

#: Causes of dropped images: lost packets; a malformed or foreign packet header; a wrong packet size or number of
#: packets; a new image that began before the end of the previous one.
CAUSES = ("lost_packets", "bad_header", "wrong_size", "resynchronised")
LOST, HEADER, SIZE, RESYNC = range(4)

#: The most packets lost in a row that are bridged, as in libfreenect (src/cameras.c). Sequence numbers have eight bits,
#: so the number of lost packets is not known after long gaps.
MAX_GAP = 5

# State of the assembler, an array modified by the kernel. PLACE is the index in the image of the next expected packet,
# -1 while waiting for the start of an image; the causes count images, MISSING counts packets.
PLACE, SEQ, TICKS, BEGAN, COMPLETE, MISSING, FIRST_CAUSE = range(7)
STATE_SIZE = FIRST_CAUSE + len(CAUSES)

#: A number of packets, the place of one, or its flag.
Count = int | np.integer


@kernel
def fits(place: Count, flag: Count, count: Count) -> bool | np.bool_:
    """True if a packet at a place of an image of `count` packets has this flag."""
    return 0 <= place < count and (flag == 1) == (place == 0) and (flag == 5) == (place == count - 1)


@kernel
def bridge(place: Count, lost: Count, flag: Count, gone: NDArray[np.uint8], maximum_gap: int) -> Count:
    """Place of the packet that follows `lost` lost ones; marks these in `gone`.

    Returns:
        `gone.size` if the image ends in the gap; -1 if the gap is too long, or if the flag contradicts it.
    """
    after, count = place + lost, gone.size
    if place < 0 or lost > maximum_gap:
        return -1
    if place > 0 and after >= count and fits(after - count, flag, count):
        gone[place:] = 1
        return count
    if not fits(after, flag, count):
        return -1
    if place == 0:
        gone[:] = 0
    gone[place:after] = 1
    return after


@kernel
def begin_image(packet: NDArray[np.uint8], row: Count, state: NDArray[np.int64]) -> None:
    """Keeps the time and the row of an image's first packet."""
    ticks = np.int64(0)
    for i in range(4):
        ticks |= np.int64(packet[8 + i]) << (8 * i)
    state[TICKS] = ticks
    state[BEGAN] = row


@kernel
def cross_gap(
    packet: NDArray[np.uint8],
    row: int,
    flag: Count,
    state: NDArray[np.int64],
    gone: NDArray[np.uint8],
    maximum_gap: int,
) -> None:
    """Bridges the packets lost before this one, or gives up the image; completes it if it ended with them."""
    place, lost = state[PLACE], (np.int64(packet[5]) - state[SEQ]) & 255
    after, count = bridge(place, lost, flag, gone, maximum_gap), gone.size
    if after == count:
        state[MISSING] += count - place
        state[SEQ] = (state[SEQ] + count - place) & 255
        state[PLACE] = 0
        state[COMPLETE] = 1
        return
    state[MISSING] += lost
    state[PLACE] = after
    if after < 0 and (place > 0 or (place == 0 and flag != 1)):
        state[FIRST_CAUSE + LOST] += 1
    if after > 0 and place == 0:
        begin_image(packet, row - lost, state)


@kernel
def assemble(
    packets: NDArray[np.uint8],
    lengths: NDArray[np.integer],
    begin: int,
    state: NDArray[np.int64],
    image: NDArray[np.uint8],
    gone: NDArray[np.uint8],
    base: int,
    payload: int,
    maximum_gap: int,
) -> int:
    """Copies payload into `image` until it is complete or all packets are consumed.

    Args:
        packets: (n, at least 12 + payload) uint8, one packet a row.
        lengths: (n,) number of valid bytes per row; 0 for a microframe without a packet.
        begin: first row.
        state: (STATE_SIZE,) int64, see above; BEGAN is the row of the image's first packet, negative for an
            earlier call.
        image: (bytes of an image,) uint8; places of lost packets keep what they had.
        gone: (packets of an image,) uint8, 1 for a lost packet.
        base, payload, maximum_gap: see `PacketFormat` and `Assembler`.

    Returns:
        The next row; COMPLETE of the state is 1 if an image is complete.
    """
    count = gone.size
    state[COMPLETE] = 0
    for row in range(begin, min(packets.shape[0], lengths.size)):
        length = min(lengths[row], packets.shape[1])
        if length == 0:
            continue
        place = state[PLACE]
        flag = packets[row, 3] - base if length >= HEADER_BYTES else 0
        if flag not in (1, 2, 5) or packets[row, 0] != 0x52 or packets[row, 1] != 0x42:
            if place >= 0:
                state[FIRST_CAUSE + HEADER] += 1
            state[PLACE] = -1
            state[SEQ] = -1  # the next sequence number is unknown
            continue
        seq = np.int64(packets[row, 5])
        if state[SEQ] >= 0 and seq != state[SEQ]:
            cross_gap(packets[row], row, flag, state, gone, maximum_gap)
            if state[COMPLETE]:
                return row  # to be looked at again, as a packet of the next image
            place = state[PLACE]
        state[SEQ] = (seq + 1) & 255
        if flag == 1:
            if place > 0:
                state[FIRST_CAUSE + RESYNC] += 1
            place = 0
            gone[:] = 0
            begin_image(packets[row], row, state)
        state[PLACE] = place
        if place < 0:
            continue
        offset = place * payload
        size = min(payload, image.size - offset)
        if length < HEADER_BYTES + size or not fits(place, flag, count):
            state[FIRST_CAUSE + SIZE] += 1
            state[PLACE] = -1
            continue
        for i in range(size):
            image[offset + i] = packets[row, HEADER_BYTES + i]
        state[PLACE] = place + 1
        if place + 1 == count:
            state[PLACE] = 0
            state[COMPLETE] = 1
            return row + 1
    state[BEGAN] -= packets.shape[0]
    return packets.shape[0]


@dataclass(frozen=True, eq=False)
class RawImage:
    """One raw image.

    Attributes:
        data: (bytes of an image,) uint8, packed; valid until the assembler is fed again.
        gone: places of lost packets in the image, in order; `data` has no meaning there.
        ticks: the device's counter in the first packet.
        row: row of its first packet in the packets fed last; negative for earlier ones.
        seq: sequence number; gaps are dropped images.
    """

    data: NDArray[np.uint8]
    gone: tuple[int, ...]
    ticks: int
    row: int
    seq: int


class Assembler:
    """Assembles images from the packets of one stream.

    Packets may be longer than needed (excess bytes are ignored), but not shorter.

    Args:
        form: packet format.
        maximum_gap: the most packets lost in a row that do not drop the image; 0 if images must be complete.
    """

    def __init__(self, form: PacketFormat, maximum_gap: int = 0) -> None:
        self._form = form
        self._maximum_gap = maximum_gap
        self._gone = np.zeros(form.packets, np.uint8)
        self._image = np.zeros(form.image_bytes, np.uint8)
        self._state = np.zeros(STATE_SIZE, np.int64)
        self._state[[PLACE, SEQ]] = -1
        self._dropped = dict.fromkeys(CAUSES, 0)
        self._seq = -1
        self._last_ticks = 0
        self._known = 0  # drops counted before the last complete image

    @property
    def dropped(self) -> Mapping[str, int]:
        """Dropped images, by `CAUSES`."""
        counted = self._state[FIRST_CAUSE:]
        return {cause: extra + int(counted[i]) for i, (cause, extra) in enumerate(self._dropped.items())}

    @property
    def missing(self) -> int:
        """Number of lost packets; a loss of exactly 256 in a row is not detected here, but the lost image is."""
        return int(self._state[MISSING])

    def feed(self, packets: NDArray[np.uint8], lengths: NDArray[np.integer]) -> Iterator[RawImage]:
        """Images that the packets end, in order.

        Args:
            packets: (n, drivers.kinect1.transport.packets.PACKET_BYTES), one packet a row.
            lengths: (n,) number of valid bytes per row.
        """
        row = 0
        while row < len(packets):
            row = assemble(
                packets, lengths, row, self._state, self._image, self._gone,
                self._form.base, self._form.payload, self._maximum_gap,
            )  # fmt: skip
            if self._state[COMPLETE]:
                yield self._complete()

    def _complete(self) -> RawImage:
        ticks = int(self._state[TICKS])
        known = int(self._state[FIRST_CAUSE:].sum())
        if self._seq < 0:
            self._seq = 0
        else:
            # The timestamps also reveal images of which all packets were lost.
            passed = max(1, round(((ticks - self._last_ticks) & 0xFFFFFFFF) / self._form.period_ticks))
            self._dropped["lost_packets"] += max(0, passed - 1 - (known - self._known))
            self._seq += max(passed, 1 + known - self._known)
        self._last_ticks, self._known = ticks, known
        gone = tuple(np.flatnonzero(self._gone).tolist())
        return RawImage(self._image, gone, ticks, int(self._state[BEGAN]), self._seq)

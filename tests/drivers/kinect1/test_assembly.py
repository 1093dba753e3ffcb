"""Assembly of packets: only complete images are delivered, for arbitrary damage in transit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.kinect1.assembly import CAUSES, MAX_GAP, PLACE, SEQ, STATE_SIZE, Assembler, assemble
from drivers.kinect1.transport.packets import COLOR, DEPTH, INFRARED, PACKET_BYTES, PacketFormat
from evaluation.service.kinect1_emulation.packet_stream import PacketStream, begin

#: Images of 4 packets, so that short examples contain several images.
TINY = PacketFormat(endpoint=0x82, base=0x70, payload=20, width=8, height=9, bits=8)


def stream_of(form: PacketFormat, images: int = 3, lost: float = 0.0) -> PacketStream:
    generator = np.random.default_rng(7)
    return PacketStream(form, [generator.bytes(form.image_bytes) for _ in range(images)], lost)


def feed(assembler: Assembler, packets: np.ndarray, lengths: np.ndarray, at_once: int = 64) -> list[tuple]:
    """(seq, ticks, bytes, microframe of the first packet) of every image."""
    result = []
    for row in range(0, len(packets), at_once):
        for image in assembler.feed(packets[row : row + at_once], lengths[row : row + at_once]):
            result.append((image.seq, image.ticks, image.data.tobytes(), row + image.row))
    return result


def watch(assembler: Assembler, shown: PacketStream, first: int, count: int) -> list[tuple]:
    """Images assembled from microframes; rows count from the first one."""
    result = []
    for start in range(first, first + count, 640):
        images = feed(assembler, *shown.microframes(start, min(640, first + count - start)))
        result += [(*image, start - first + row) for *image, row in images]
    return result


@pytest.mark.parametrize(("form", "packets", "last"), [(DEPTH, 242, 1132), (COLOR, 162, 12), (INFRARED, 205, 1168)])
def test_packet_counts_of_the_formats(form: PacketFormat, packets: int, last: int) -> None:
    assert form.packets == packets
    assert form.image_bytes - (packets - 1) * form.payload == last


@pytest.mark.parametrize("form", [DEPTH, COLOR, INFRARED])
def test_without_loss_every_image_is_assembled(form: PacketFormat) -> None:
    shown, assembler = stream_of(form), Assembler(form)
    images = watch(assembler, shown, 0, 8000)
    assert [image[:3] for image in images] == [(i, i * 2_000_000, shown.shown(i)) for i in range(30)]
    assert [image[3] for image in images] == [begin(i) for i in range(30)]
    assert set(assembler.dropped.values()) == {0}


def test_images_with_lost_packets_are_dropped_and_counted() -> None:
    shown, assembler = stream_of(DEPTH, lost=0.01), Assembler(DEPTH)
    images = watch(assembler, shown, 0, 60 * 8000)
    first = (images[0][1]) // DEPTH.period_ticks
    assert all(data == shown.shown(first + seq) for seq, _, data, _ in images)
    assert [seq + first for seq, *_ in images] == [i for i in range(1800) if shown.is_whole(i)]
    last = images[-1][0]
    # After the last complete image, a further drop may have been noticed already.
    assert 0 <= sum(assembler.dropped.values()) - first - (last + 1 - len(images)) < 60
    assert assembler.dropped["lost_packets"] == sum(assembler.dropped.values())
    assert 0.009 < assembler.missing / (60 * 30 * DEPTH.packets) < 0.011


def test_completely_lost_images_are_counted_by_the_timestamps() -> None:
    shown, assembler = stream_of(DEPTH), Assembler(DEPTH)
    watch(assembler, shown, 0, begin(3))
    images = watch(assembler, shown, begin(10), 800)
    assert [seq for seq, *_ in images] == [10, 11, 12]
    assert assembler.dropped["lost_packets"] == 7


def test_sequence_numbers_continue_across_a_tick_wrap() -> None:
    shown, assembler = stream_of(COLOR), Assembler(COLOR)
    wrap = 2**32 // COLOR.period_ticks
    images = watch(assembler, shown, begin(wrap - 1), 1600)
    assert [seq for seq, *_ in images] == list(range(6))
    assert images[3][1] < images[0][1]


@pytest.mark.parametrize(
    ("change", "causes"),
    [
        (lambda p, n: n.__setitem__(1, 25), "wrong_size"),
        (lambda p, n: p.__setitem__((1, 0), 0), "bad_header"),
        (lambda p, n: p.__setitem__((1, 3), 0x82), "bad_header"),
        (lambda p, n: n.__setitem__(1, 11), "bad_header"),
        (lambda p, n: n.__setitem__(1, 0), "lost_packets"),
        (lambda p, n: p.__setitem__((1, 3), 0x71), "resynchronised wrong_size"),
        (lambda p, n: p.__setitem__((1, 3), 0x75), "wrong_size"),
        (lambda p, n: p.__setitem__((3, 3), 0x72), "wrong_size"),
    ],
)
def test_a_corrupt_packet_drops_its_image_with_the_cause(change, causes: str) -> None:
    shown, assembler = stream_of(TINY), Assembler(TINY)
    packets, lengths = shown.microframes(0, 600)
    change(packets, lengths)
    images = feed(assembler, packets, lengths)
    assert [data for _, _, data, _ in images] == [shown.shown(1), shown.shown(2)]
    assert {cause for cause, number in assembler.dropped.items() if number == 1} == set(causes.split())
    assert sum(assembler.dropped.values()) == len(causes.split())


def test_excess_bytes_of_a_packet_are_ignored() -> None:
    shown, assembler = stream_of(DEPTH), Assembler(DEPTH)
    packets, lengths = shown.microframes(0, 400)
    lengths[lengths > 0] = PACKET_BYTES
    assert [data for _, _, data, _ in feed(assembler, packets, lengths)] == [shown.shown(0)]


def reference(form: PacketFormat, packets: np.ndarray, lengths: np.ndarray) -> tuple[list[bytes], dict[str, int]]:
    """Reference implementation: images and drops, packet by packet, without sequence numbers."""
    images: list[bytes] = []
    dropped: dict[str, int] = dict.fromkeys(CAUSES, 0)
    parts: list[bytes] | None = None  # of the image so far; None while the beginning of one is awaited
    expected = None
    for packet, length in zip(packets, lengths.tolist()):
        data = packet[: min(length, PACKET_BYTES)].tobytes()
        if not data:
            continue
        if len(data) < 12 or data[:2] != b"RB" or data[3] - form.base not in (1, 2, 5):
            dropped["bad_header"] += parts is not None
            parts = expected = None
            continue
        kind = data[3] - form.base
        if expected is not None and data[5] != expected:
            dropped["lost_packets"] += bool(parts) or (parts == [] and kind != 1)
            parts = None
        expected = (data[5] + 1) % 256
        if kind == 1:
            dropped["resynchronised"] += bool(parts)
            parts = []
        if parts is None:
            continue
        wanted = min(form.payload, form.image_bytes - len(parts) * form.payload)
        right_kind = 1 if not parts else 5 if len(parts) == form.packets - 1 else 2
        if len(data) < 12 + wanted or kind != right_kind:
            dropped["wrong_size"] += 1
            parts = None
            continue
        parts.append(data[12 : 12 + wanted])
        if kind == 5:
            images.append(b"".join(parts))
            parts = []
    return images, dropped


DAMAGE = st.tuples(
    st.integers(0, 39),
    st.one_of(
        st.tuples(st.just("byte"), st.integers(0, 12), st.integers(0, 255)),
        st.tuples(st.just("length"), st.integers(0, 2**32 - 1), st.just(0)),
        st.tuples(st.just("again"), st.integers(0, 39), st.just(0)),
    ),
)


@settings(max_examples=200)
@given(st.lists(DAMAGE, max_size=8), st.integers(1, 17))
def test_corrupt_packets_are_handled_as_by_the_reference(damages: list, at_once: int) -> None:
    shown = stream_of(TINY)
    rows = np.concatenate([np.arange(begin(i), begin(i) + TINY.packets) for i in range(10)])
    packets, lengths = (part[rows].copy() for part in shown.microframes(0, 2700))
    for row, (what, value, byte) in damages:
        if what == "byte":
            packets[row, value] = byte
        elif what == "length":
            lengths[row] = value
        else:
            packets[row], lengths[row] = packets[value].copy(), lengths[value]
    assembler = Assembler(TINY)
    images, dropped = reference(TINY, packets, lengths)
    assert [data for _, _, data, _ in feed(assembler, packets, lengths, at_once)] == images
    for cause in CAUSES[1:]:
        assert assembler.dropped[cause] == dropped[cause]
    assert assembler.dropped["lost_packets"] >= dropped["lost_packets"]


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), st.sampled_from([DEPTH, COLOR, INFRARED]), st.sampled_from([0, MAX_GAP]))
def test_arbitrary_packets_write_no_byte_outside_the_image(seed: int, form: PacketFormat, maximum_gap: int) -> None:
    generator = np.random.default_rng(seed)
    packets = generator.integers(0, 256, (300, PACKET_BYTES), np.uint8)
    plausible = generator.random(300) < 0.9
    packets[plausible, :2] = np.frombuffer(b"RB", np.uint8)
    packets[plausible, 3] = form.base + generator.choice([1, 2, 2, 5], plausible.sum())
    packets[plausible, 5] = np.arange(plausible.sum()) & 255
    lengths = generator.integers(0, 2**32, 300, np.uint32)
    # The image is a view of a larger array with guard bytes at both ends.
    guarded = np.full(form.image_bytes + 2048, 0xA5, np.uint8)
    state = np.zeros(STATE_SIZE, np.int64)
    state[[PLACE, SEQ]] = -1
    row = 0
    while row < len(packets):
        image, gone = guarded[1024:-1024], np.zeros(form.packets, np.uint8)
        row = assemble(packets, lengths, row, state, image, gone, form.base, form.payload, maximum_gap)
    assert (guarded[:1024] == 0xA5).all()
    assert (guarded[-1024:] == 0xA5).all()

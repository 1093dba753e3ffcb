"""Small gaps of a depth image are pixels without return; everything else of it is what was shown."""

import numpy as np
import pytest

from drivers.kinect1 import unpacking
from drivers.kinect1.assembly import MAX_GAP, Assembler
from drivers.kinect1.camera import Stream
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.stream_decoder import StreamDecoder
from drivers.kinect1.transport.packets import DEPTH
from drivers.kinect1.transport.transfer import Transfer
from evaluation.service.kinect1_emulation.packet_stream import begin
from tests.drivers.kinect1.test_assembly import TINY, stream_of

PLANE = ReferencePlane()


def test_depth_images_with_lost_packets_are_delivered_with_no_return_where_they_were() -> None:
    """One packet in a hundred lost: all images arrive, and every pixel is the one that was shown or has no return."""
    shown, decoder, table = stream_of(DEPTH, lost=0.01), StreamDecoder(Stream.DEPTH, "", PLANE), PLANE.table()
    truth = [unpacking.depth(np.frombuffer(shown.shown(i), np.uint8), table, 480, 640) for i in range(3)]
    frames = []
    for first in range(0, 20 * 8000, 64):
        packets, lengths = shown.microframes(first, 64)
        frames += [frame for frame, _ in decoder.decode(Transfer(0x82, packets, lengths, first * 125_000))]
    incomplete = [frame for frame in frames if frame.incomplete]
    for frame in frames:
        lost = frame.data != truth[frame.t_device_ticks // DEPTH.period_ticks % 3]
        assert (frame.data[lost] == 0).all()
        assert lost.any() == frame.incomplete
        assert lost.mean() < 0.06
    numbers = [frame.t_device_ticks // DEPTH.period_ticks for frame in frames]
    assert numbers == sorted(set(numbers))
    assert [frame.seq for frame in frames] == [number - numbers[0] for number in numbers]
    # Each packet is 1271 pixels and parts of two more; random images have no return in one pixel of 2048.
    print(f"{len(frames)} of 600 images, {len(incomplete)} of them incomplete")
    assert len(frames) > 0.99 * 600
    assert decoder.gauges["depth.incomplete_images"] == len(incomplete) > 0.8 * len(frames)
    assert sum(decoder.dropped.values()) < 0.01 * 600


@pytest.mark.parametrize("places", [(0,), (0, 1), (2,), (3,), (1, 2), (2, 3), (3, 4), (2, 3, 4, 5)])
def test_a_gap_anywhere_in_an_image_is_bridged(places: tuple[int, ...]) -> None:
    """Packets are lost from the second image on; what is left of each image is the one that was shown."""
    shown, assembler = stream_of(TINY), Assembler(TINY, MAX_GAP)
    rows = np.concatenate([np.arange(begin(i), begin(i) + TINY.packets) for i in range(4)])
    packets, lengths = (part[rows] for part in shown.microframes(0, 1200))
    lengths[[TINY.packets + place for place in places]] = 0
    images = []
    for image in assembler.feed(packets, lengths):
        present = np.ones(TINY.image_bytes, bool)
        for place in image.gone:
            present[TINY.pixels(place)] = False
        expected = np.frombuffer(shown.shown(image.ticks // TINY.period_ticks), np.uint8)
        np.testing.assert_array_equal(image.data[present], expected[present])
        images.append((image.seq, image.gone))
    lost = [tuple(place - TINY.packets * n for place in places if place // TINY.packets == n) for n in (0, 1)]
    assert images == [(0, ()), (1, lost[0]), (2, lost[1]), (3, ())]
    assert assembler.missing == len(places)
    assert set(assembler.dropped.values()) == {0}


def test_a_longer_gap_drops_its_image() -> None:
    shown, assembler = stream_of(DEPTH), Assembler(DEPTH, MAX_GAP)
    packets, lengths = shown.microframes(0, 800)
    lengths[20 : 20 + MAX_GAP + 1] = 0
    assert [image.seq for image in assembler.feed(packets, lengths)] == [0, 1]
    assert assembler.dropped == {"lost_packets": 1, "bad_header": 0, "wrong_size": 0, "resynchronised": 0}

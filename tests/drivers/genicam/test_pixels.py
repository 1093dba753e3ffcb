"""Pixel formats, by the names of GenICam's PFNC."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.contract.frame import Geometry, Kind, Reference
from drivers.genicam.features import Distances
from drivers.genicam.link import Part, Shot
from drivers.genicam.pixels import PixelError, frames

MILLIMETRES = Distances(1e-3, 0.0, 0.0, Geometry.Z)
DEPTH = np.array([[1000, 0, 1500], [2000, 2500, 3000]], np.uint16)
METRES = np.array([[1.0, np.nan, 1.5], [2.0, 2.5, 3.0]])


def part(name: str, values: NDArray[np.generic], padding: int = 0) -> Part:
    rows = np.ascontiguousarray(values).view(np.uint8).reshape(2, -1)
    return Part(name, 3, 2, memoryview(np.pad(rows, ((0, 0), (0, padding))).tobytes()), padding)


def made(*parts: Part, distances: Distances = MILLIMETRES, time_ns: int | None = None):
    return {frame.kind: frame for frame in frames(Shot(5, time_ns, parts), distances, "id", 0.001)}


@pytest.mark.parametrize(("name", "index"), [("C", 0), ("CY", 0), ("ABC", 2), ("ABCY", 2)])
def test_distances_come_out_of_every_layout(name: str, index: int) -> None:
    channels = np.full((2, 3, len(name)), 77, np.uint16)
    channels[:, :, index] = DEPTH
    images = made(part(f"Coord3D_{name}16", channels, padding=4))
    np.testing.assert_allclose(images[Kind.DEPTH].si(), METRES, rtol=1e-6)
    assert images[Kind.DEPTH].geometry == Geometry.Z
    assert (Kind.INTENSITY in images) == ("Y" in name)
    if "Y" in name:
        assert np.all(images[Kind.INTENSITY].data == 77)


def test_what_follows_the_last_row_is_no_padding() -> None:
    chunks = b"\xff" * 20
    images = made(Part("Coord3D_C16", 3, 2, memoryview(DEPTH.tobytes() + chunks)))
    np.testing.assert_allclose(images[Kind.DEPTH].si(), METRES, rtol=1e-6)


def test_distances_in_planes_or_with_an_offset_are_the_same() -> None:
    planes = np.stack([DEPTH * 0, DEPTH * 0, DEPTH]).astype("<f4")
    planar = Part("Coord3D_ABC32f_Planar", 3, 2, memoryview(planes.tobytes()))
    np.testing.assert_allclose(made(planar)[Kind.DEPTH].si(), METRES, rtol=1e-6)
    moved = made(part("Coord3D_C16", DEPTH), distances=Distances(1e-3, 0.5, 0.0, Geometry.RADIAL))[Kind.DEPTH]
    np.testing.assert_allclose(moved.si(), METRES + 0.5, rtol=1e-6)
    assert moved.geometry == Geometry.RADIAL


def test_other_images_keep_their_values_and_a_plane_without_c_is_left_out() -> None:
    images = made(
        part("Coord3D_A32f", DEPTH.astype("<f4")),
        part("Mono16", DEPTH),
        part("Confidence8", DEPTH.astype(np.uint8)),
        part("RGBa8", np.full((2, 3, 4), 9, np.uint8)),
        time_ns=12,
    )
    assert {kind: frame.encoding for kind, frame in images.items()} == {
        Kind.INTENSITY: "mono16",
        Kind.CONFIDENCE: "mono8",
        Kind.COLOR: "rgb8",
    }
    frame = images[Kind.INTENSITY]
    assert np.array_equal(frame.data, DEPTH)
    assert (frame.t_device_ticks, frame.tick_hz, frame.t_reference, frame.seq) == (12, 1e9, Reference.START, 5)
    assert math.isclose(frame.exposure_s, 0.001)


def test_unknown_formats_and_short_images_are_refused() -> None:
    with pytest.raises(PixelError, match="Mono12p: unknown format"):
        made(part("Mono12p", DEPTH))
    with pytest.raises(PixelError, match="12 bytes are too few"):
        made(part("Coord3D_ABC16", DEPTH))
    with pytest.raises(PixelError, match="Coord3D_C8 is not supported"):
        made(part("Coord3D_C8", DEPTH.astype(np.uint8)))

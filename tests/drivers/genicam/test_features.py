"""Readings of a camera's features, through the real GenApi."""

from typing import Any

import numpy as np
import pytest

from drivers.contract.device import ControlError, DeviceError
from drivers.contract.errors import translated_sdk_errors
from drivers.contract.frame import Geometry
from drivers.genicam import controls, features
from drivers.genicam.address import parse
from drivers.genicam.features import Distances
from tests.drivers.genicam.node_map import BLAZE, HELIOS, node_map

ANY = parse("genicam://")


class Link:
    def __init__(self, nodes: Any) -> None:
        self.nodes = nodes

    def translated_errors(self):
        return translated_sdk_errors("genicam://", "")


def test_distances_are_metres_along_the_axis_or_radial() -> None:
    assert features.distances(node_map(BLAZE), "genicam://") == Distances(0.25e-3, 0.0, 7.0, Geometry.Z)
    spherical = {"Scan3dCoordinateSystem": ["Spherical"], "Scan3dCoordinateOffset": 2.0, "Scan3dInvalidDataFlag": False}
    reported = features.distances(node_map(BLAZE | spherical | {"Scan3dDistanceUnit": ["Inch"]}), "genicam://")
    assert reported == Distances(0.25 * 0.0254, 2 * 0.0254, 0.0, Geometry.RADIAL)


def test_the_scale_is_that_of_coordinate_c() -> None:
    selected = HELIOS | {"Scan3dCoordinateSelector": ["CoordinateA", "CoordinateB", "CoordinateC"]}
    nodes = node_map(selected)
    features.distances(nodes, "genicam://")
    assert nodes.Scan3dCoordinateSelector.value == "CoordinateC"


@pytest.mark.parametrize(
    ("feature", "choice", "message"),
    [
        ("Scan3dOutputMode", "DisparityC", "Scan3dOutputMode is DisparityC"),
        ("Scan3dOutputMode", "CalibratedABC_PointCloud", "hold no distances"),
        ("Scan3dDistanceUnit", "Pixel", "Millimeter or Inch"),
        ("Scan3dCoordinateSystemReference", "Transformed", "Anchor"),
    ],
)
def test_what_is_no_distance_is_refused(feature: str, choice: str, message: str) -> None:
    with pytest.raises(DeviceError, match=message):
        features.distances(node_map(BLAZE | {feature: [choice]}), "genicam://")


def test_the_smallest_format_of_distances_is_taken_unless_one_is_named() -> None:
    blaze, helios = node_map(BLAZE), node_map(HELIOS)
    features.configure(blaze, ANY)
    features.configure(helios, ANY)
    assert (blaze.ComponentSelector.value, blaze.PixelFormat.value) == ("Range", "Coord3D_C16")
    assert helios.PixelFormat.value == "Coord3D_CY16"
    features.configure(blaze, parse("genicam://?format=Coord3D_ABC32f"))
    assert blaze.PixelFormat.value == "Coord3D_ABC32f"
    with pytest.raises(DeviceError, match="'Coord3D_C8' is none of Mono16, Coord3D_ABC32f, Coord3D_C16"):
        features.configure(blaze, parse("genicam://?format=Coord3D_C8"))


def test_the_camera_is_that_of_the_sfnc_or_of_lucid_or_nominal() -> None:
    blaze = features.camera(node_map(BLAZE), 640, 480, ANY)
    assert (blaze.fx, blaze.fy, blaze.cx, blaze.cy) == (510, 510, 319, 241)
    helios = features.camera(node_map(HELIOS), 640, 480, ANY)
    assert (helios.fx, helios.fy, helios.cx, helios.cy) == (520, 521, 322, 239)
    np.testing.assert_allclose(helios.lens.coefficients[:5], [0.01, 0.02, 0.03, 0.04, 0.05])
    nominal = features.camera(node_map({}), 640, 480, parse("genicam://?focal=500"))
    assert (nominal.fx, nominal.fy, nominal.cx, nominal.cy) == (500, 500, 319.5, 239.5)
    with pytest.raises(DeviceError, match="focal=PIXELS"):
        features.camera(node_map({}), 640, 480, ANY)


def test_controls_are_in_si_units_and_reach_the_camera() -> None:
    nodes = node_map(BLAZE)
    made = controls.make(Link(nodes))  # pyright: ignore[reportArgumentType]
    assert [info.name for info in made.infos] == ["exposure_s", "modulation", "auto_exposure"]
    assert made.get("exposure_s") == pytest.approx(controls.exposure_s(nodes)) == pytest.approx(1e-3)
    made.set("exposure_s", 0.0005)
    made.set("auto_exposure", True)
    made.set("modulation", "LongRange")
    assert (nodes.ExposureTime.value, nodes.ExposureAuto.value, nodes.OperatingMode.value) == (
        pytest.approx(500),
        "Continuous",
        "LongRange",
    )
    with pytest.raises(ControlError, match=r"0\.0001 to 0\.002 s"):
        made.set("exposure_s", 1.0)
    helios = controls.make(Link(node_map(HELIOS)))  # pyright: ignore[reportArgumentType]
    assert helios.get("exposure") == "Exp62_5Us"

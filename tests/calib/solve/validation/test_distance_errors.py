"""Distances of the wrong geometry, and a displaced depth image, are named; both were trusted."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from calib.board.views import PlaneView
from calib.camera import Camera
from calib.lenses.lens import LensError
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.distance_errors import DistanceShift, Misread, distance_errors
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

HEADS = {name: head for name, head in board_views.three_heads().items() if name != "light"}
Spoil = Callable[[PlaneView, Camera], PlaneView]


def as_they_are(view: PlaneView, _: Camera) -> PlaneView:
    return view


def z_as_radial(view: PlaneView, camera: Camera) -> PlaneView:
    return replace(view, distances=view.distances * camera.directions(view.pixels)[:, 2])


def radial_as_z(view: PlaneView, camera: Camera) -> PlaneView:
    return replace(view, distances=view.distances / camera.directions(view.pixels)[:, 2])


def displaced(view: PlaneView, _: Camera) -> PlaneView:
    return replace(view, pixels=view.pixels + np.array([6, -2]))


def solved(spoil: Spoil, keeps: bool, terms: tuple[str, ...] = (), own_image: bool = True) -> Solution:
    random = np.random.default_rng(0)
    heads = HEADS if own_image else HEADS | {"tof": replace(HEADS["tof"], corner_sigma=0.0)}
    seen = board_views.look(heads, board_views.random_boards(12, random), random)
    planes = [spoil(view, HEADS[view.sensor].camera) for view in seen.planes]
    sensors = {
        name: SensorTask(
            head.camera.width,
            head.camera.height,
            factory=(head.camera,),
            fixed_intrinsics=keeps or not head.corner_sigma,
            depth_terms=terms if name == "tof" else (),
        )
        for name, head in heads.items()
    }
    return calibrate(Task(sensors, seen.corners, planes, "tof" if own_image else "color"))


@pytest.mark.parametrize("own_image", [True, False])
def test_distances_as_they_are_said_to_be_are_no_mistake(own_image: bool) -> None:
    assert distance_errors(solved(as_they_are, True, own_image=own_image), 1.0) == []


@pytest.mark.parametrize("terms", [(), ("depth_offset", "depth_scale")])
@pytest.mark.parametrize(
    ("spoil", "exponent", "said"),
    [
        (z_as_radial, 1, "look like z, along the optical axis, and are taken as radial"),
        (radial_as_z, -1, "look like radial, from the camera centre, and are taken as z"),
    ],
)
def test_the_other_geometry_is_named(spoil: Spoil, exponent: float, said: str, terms: tuple[str, ...]) -> None:
    solution = solved(spoil, not terms, terms)
    (found,) = distance_errors(solution, 1.0)
    assert isinstance(found, Misread)
    assert found.exponent == pytest.approx(exponent, abs=0.3)
    assert assess(solution, 1.0, 1.0).verdict.startswith(f"Do not trust it yet: tof: its distances {said}: ")


def test_the_other_geometry_is_named_of_a_sensor_without_an_image() -> None:
    (found,) = distance_errors(solved(z_as_radial, True, own_image=False), 1.0)
    assert isinstance(found, Misread)


def test_a_displaced_depth_image_is_named_with_its_shift() -> None:
    solution = solved(displaced, True)
    (found,) = distance_errors(solution, 1.0)
    assert isinstance(found, DistanceShift)
    np.testing.assert_allclose(found.shift, (6, -2), atol=1.5)
    assert assess(solution, 1.0, 1.0).verdict.startswith("Do not trust it yet: tof: its depth image is displaced by (+")
    assert distance_errors(solution, 10.0) == []


@pytest.mark.parametrize(("scale", "offset"), [(1.019, 0.0), (1.0, 0.03)])
def test_distances_that_are_too_long_are_none_of_these_mistakes(scale: float, offset: float) -> None:
    too_long = solved(lambda view, _: replace(view, distances=scale * view.distances + offset), True)
    assert distance_errors(too_long, 1.0) == []


def test_a_depth_sensor_without_an_image_may_look_elsewhere() -> None:
    assert distance_errors(solved(displaced, True, own_image=False), 1.0) == []


def test_pixels_beside_that_no_lens_can_show_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    solution, directions = solved(as_they_are, True), Camera.directions
    furthest = max(view.pixels[:, 0].max() for view in solution.task.planes)

    def none_beside(camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        if pixels[:, 0].max() > furthest:
            raise LensError("no direction")
        return directions(camera, pixels)

    monkeypatch.setattr(Camera, "directions", none_beside)
    assert distance_errors(solution, 1.0) == []

"""A mesh that was lost is laid over what is found, bent as that is and hardly turned."""

import numpy as np
import pytest

from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.models.flexpad import FlexPad
from abs_service.tracker.models.nurbs import Settings
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.posterior.relocation import fit_to_points
from calib import pose
from tests.abs_service.tracker.scenes import flat, sheet

MESH = sheet(13, 19, flat)
AT_REST = pose.from_rotation_vector((0, 0, 0), (0, 0, 1))


def bent(degrees: float, turn: tuple[float, float, float], center: tuple[float, float, float]) -> np.ndarray:
    """Points on an arc of the sheet's size, elsewhere."""
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, 61), np.linspace(-0.1, 0.1, 41))
    radius = 0.3 / np.deg2rad(degrees)
    arc = np.stack([radius * np.sin(x / radius), y, radius * (np.cos(x / radius) - 1)], axis=-1).reshape(-1, 3)
    return pose.transform(pose.from_rotation_vector(turn, center), arc)


@pytest.mark.parametrize(
    "model",
    [Settings((5, 4), 3).of_mesh(MESH), FlexPad(Sheet(AT_REST, 0.3, 0.2), 250, 0.1, 1.0)],
    ids=["nurbs", "flexpad"],
)
@pytest.mark.parametrize("degrees", [70, -70])
def test_it_lies_on_what_was_found(model: DeformationModel, degrees: float):
    points = bent(degrees, (0.3, -0.4, 0.9), (0.12, -0.05, 1.1))
    theta = fit_to_points(model, model.rest, points)
    vertices = model.deform(theta[None]).vertices[0].T
    apart = np.linalg.norm(vertices[:, None] - points, axis=2)
    assert apart.min(axis=1).mean() < 8e-3
    assert apart.min(axis=0).mean() < 12e-3


def test_it_is_turned_as_little_as_possible():
    """Upside down, a sheet is the same points; which way up it is tells the last pose that was trusted."""
    model, points = Rigid(MESH), bent(1e-3, (0, 0, np.deg2rad(100)), (0.1, 0, 1))
    for last, found in ((0.0, -80), (170.0, 100)):
        theta = fit_to_points(model, np.array([0, 0, np.deg2rad(last), 0, 0, 0]), points)
        moved = model.deform(theta[None]).vertices[0].T - (0.1, 0, 1)
        right = MESH.vertices[:, 0] > 0.1
        direction = moved[right].mean(axis=0)
        assert np.rad2deg(np.arctan2(direction[1], direction[0])) == pytest.approx(found, abs=2)

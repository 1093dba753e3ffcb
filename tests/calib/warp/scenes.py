"""Two cameras, and what they see of planes and balls, by casting rays: no part of the warping takes part."""

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from evaluation.scenes.solids import Ball, Plane, cast, image, seen_by

__all__ = ["BOARD", "SOURCE", "VIEWS", "WALL", "Ball", "Plane", "cast", "image", "seen_by"]

SOURCE = Camera(64, 56, 60.0, 60.5, 31.2, 28.1, Lens(np.array([-0.15, 0.03, 1e-3, -1e-3])))
BESIDE = pose.from_rotation_vector([0.02, -0.2, 0.03], [0.22, -0.02, 0.01])
VIEWS = {
    "pinhole": Camera(96, 72, 85.0, 86.0, 47.1, 35.8, T_rs=BESIDE),
    "brown_conrady": Camera(96, 72, 85.0, 86.0, 47.1, 35.8, Lens(np.array([-0.12, 0.03])), BESIDE),
    "fisheye": Camera(96, 72, 60.0, 61.0, 47.1, 35.8, KannalaBrandt(np.array([0.02, -0.01, 4e-3, -1e-3])), BESIDE),
}
WALL = Plane(np.array([-0.2, 0.1, 1.0]), 1.2)
BOARD = Plane(np.array([0.1, 0.05, 1.0]), 0.8, (-0.11, 0.13, -0.09, 0.12))

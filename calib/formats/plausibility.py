"""Implausible cameras: signs of a unit, an image size or a kind of lens that was misread."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt

#: Largest distance of two cameras of a rig [m].
LARGEST_BASELINE_M = 5.0

#: Least and largest field of view along the width or height of an image [rad], by the focal length alone.
FIELDS_OF_VIEW = np.deg2rad(1.0), np.deg2rad(170.0)


def doubts(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Implausible values of single cameras; empty if there are none."""
    found = []
    for name, one in cameras.items():
        is_fisheye = isinstance(one.lens, KannalaBrandt)
        reach = np.array([one.width / one.fx, one.height / one.fy])
        fields = reach if is_fisheye else 2 * np.arctan(reach / 2)
        least, most = FIELDS_OF_VIEW[0], 2 * np.pi if is_fisheye else FIELDS_OF_VIEW[1]
        if not np.all((fields > least) & (fields < most)):
            angles = " × ".join(f"{np.rad2deg(field):.3g}°" for field in fields)
            found.append(
                f"{name}: its field of view is {angles}. Are fx = {one.fx:g} and fy = {one.fy:g} in pixels of images "
                f"of {one.width} × {one.height}?"
            )
        if not (0 <= one.cx <= one.width and 0 <= one.cy <= one.height):
            found.append(
                f"{name}: its principal point ({one.cx:g}, {one.cy:g}) is outside of its images of {one.width} × "
                f"{one.height} pixels. Was it calibrated with others?"
            )
    return tuple(found)


def baselines(cameras: Mapping[str, Camera]) -> dict[str, tuple[float, float]]:
    """Distance [m] and angle [rad] of every pair of cameras, by "first, second"."""
    found = {}
    for (first, one), (second, other) in combinations(cameras.items(), 2):
        T = one.T_sr @ other.T_rs
        cosine = (np.trace(T[:3, :3]) - 1) / 2
        found[f"{first}, {second}"] = float(np.linalg.norm(T[:3, 3])), float(np.arccos(np.clip(cosine, -1, 1)))
    return found

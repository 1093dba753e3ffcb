"""Implausible cameras: signs of a unit, an image size or a kind of lens that was misread."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt

#: Largest distance of two cameras of a rig [m].
MAX_BASELINE_M = 5.0

#: Least and largest field of view along the width or height of an image [rad], by the focal length alone.
FIELDS_OF_VIEW = np.deg2rad(1.0), np.deg2rad(170.0)

#: Distance of the principal point from the middle, in parts of the image, beyond which it may be that of another image.
OFF_MIDDLE = 0.1

#: Cameras that are turned by less look the same way [rad].
SAME_WAY = np.deg2rad(45.0)

_SIDES = (("to the left of", "to the right of"), ("above", "below"), ("behind", "in front of"))


def doubts(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Implausible values of single cameras; empty if there are none."""
    found = []
    for name, one in cameras.items():
        is_fisheye = isinstance(one.lens, KannalaBrandt)
        reach = np.array([one.width / one.fx, one.height / one.fy])
        fields = reach if is_fisheye else 2 * np.arctan(reach / 2)
        minimum, maximum = FIELDS_OF_VIEW[0], 2 * np.pi if is_fisheye else FIELDS_OF_VIEW[1]
        if not np.all((fields > minimum) & (fields < maximum)):
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
        elif is_turned(one):
            found.append(
                f"{name}: its principal point ({one.cx:g}, {one.cy:g}) is in the middle of images of {one.height} × "
                f"{one.width} pixels, not of {one.width} × {one.height}. Are width and height exchanged, or cx and cy?"
            )
    return tuple(found)


def is_turned(one: Camera) -> bool:
    """True if the principal point is in the middle only of images whose width and height are exchanged."""
    size, middle = np.array([one.width, one.height]), np.array([one.cx, one.cy])
    as_said, exchanged = (np.abs(middle / each - 0.5) for each in (size, size[::-1]))
    return bool(np.all(as_said > OFF_MIDDLE) and np.all(exchanged < OFF_MIDDLE / 2))


@dataclass(frozen=True)
class Baseline:
    """Place and direction of the second camera of a pair relative to the first.

    Attributes:
        length: distance [m].
        angle: by which it is turned [rad].
        side: where it is for the first one, such as "to the right of".
    """

    length: float
    angle: float
    side: str

    def __str__(self) -> str:
        """Distance and angle, to check with a ruler."""
        return f"{self.length * 1e3:.1f} mm apart, turned by {np.rad2deg(self.angle):.2f}°"


def baselines(cameras: Mapping[str, Camera]) -> dict[str, Baseline]:
    """Baseline of every pair of cameras, by "first, second"."""
    return {
        f"{first}, {second}": _baseline(one, other)
        for (first, one), (second, other) in combinations(cameras.items(), 2)
    }


def exchanged(cameras: Mapping[str, Camera]) -> list[str]:
    """Doubts about pairs that are called left and right, look the same way, and stand the other way round."""
    found = []
    for left, one in cameras.items():
        right = left.replace("left", "right")
        if left == right or right not in cameras:
            continue
        baseline = _baseline(one, cameras[right])
        if baseline.side == "to the left of" and baseline.angle < SAME_WAY:
            found.append(
                f"{right} stands {baseline.length * 1e3:.1f} mm to the left of {left}, as they see it: are their names "
                "exchanged, or all images mirrored?"
            )
    return found


def _baseline(one: Camera, other: Camera) -> Baseline:
    T = one.T_sr @ other.T_rs
    cosine = (np.trace(T[:3, :3]) - 1) / 2
    axis = int(np.argmax(np.abs(T[:3, 3])))
    side = _SIDES[axis][int(T[axis, 3] > 0)]
    return Baseline(float(np.linalg.norm(T[:3, 3])), float(np.arccos(np.clip(cosine, -1, 1))), side)

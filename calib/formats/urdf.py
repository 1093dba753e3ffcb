"""URDF, write only: camera frames as links on fixed joints below the rig's link.

REP 103: `NAME_optical_frame` has z forward and x right, as in this package; `NAME_link` has x forward and z up.
"""

import warnings
from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from calib import pose
from calib.camera import Camera
from calib.formats.content import Written
from calib.pose import Pose

#: Link of the rig's frame.
BASE = "rig"

#: Maps the optical frame to the link: forward, left, up are z, −x, −y.
T_LINK_OPTICAL: Pose = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def write(cameras: Mapping[str, Camera]) -> Written:
    """Poses of all cameras; everything else is lost."""
    robot = ElementTree.Element("robot", name=BASE)
    ElementTree.SubElement(robot, "link", name=BASE)
    for name, one in cameras.items():
        _add(robot, BASE, f"{name}_link", one.T_rs @ pose.inverse(T_LINK_OPTICAL))
        _add(robot, f"{name}_link", f"{name}_optical_frame", T_LINK_OPTICAL)
    ElementTree.indent(robot)
    text = '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"
    return Written(text, ("image sizes, camera matrices and lenses",))


def roll_pitch_yaw(T_ab: Pose) -> list[float]:
    """URDF's angles of a rotation [rad]: about the fixed axes x, y and z, in this order."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where pitch is ±90° the choice of the other two is SciPy's, and is right
        return Rotation.from_matrix(T_ab[:3, :3]).as_euler("xyz").tolist()


def _add(robot: ElementTree.Element, parent: str, child: str, T_parent_child: Pose) -> None:
    ElementTree.SubElement(robot, "link", name=child)
    joint = ElementTree.SubElement(robot, "joint", name=f"{child}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    xyz = " ".join(repr(float(number)) for number in T_parent_child[:3, 3])
    rpy = " ".join(repr(float(number)) for number in roll_pitch_yaw(T_parent_child))
    ElementTree.SubElement(joint, "origin", xyz=xyz, rpy=rpy)

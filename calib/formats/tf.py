"""ROS static transforms, write only: YAML of `geometry_msgs/TransformStamped`, one for each camera's optical frame."""

from collections.abc import Mapping

import yaml

from calib import pose
from calib.camera import Camera
from calib.formats.content import Written
from calib.formats.urdf import BASE


def write(cameras: Mapping[str, Camera]) -> Written:
    """Poses of all cameras; everything else is lost."""
    transforms = [
        {
            "header": {"frame_id": BASE},
            "child_frame_id": f"{name}_optical_frame",
            "transform": {
                "translation": dict(zip("xyz", one.T_rs[:3, 3].tolist())),
                "rotation": dict(zip("xyzw", pose.to_quaternion(one.T_rs).tolist())),
            },
        }
        for name, one in cameras.items()
    ]
    text = yaml.safe_dump({"transforms": transforms}, sort_keys=False)
    return Written(text, ("image sizes, camera matrices and lenses",))

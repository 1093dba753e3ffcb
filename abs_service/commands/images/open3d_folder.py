"""The intrinsics beside the images that Open3D's recorders write, as the camera file of `abs-service import`.

Source: `save_intrinsic_as_json` in Open3D's `realsense_recorder.py`, and its `intrinsic.json` of RGBD videos. They
register depth to the view of the colour camera, so both have one camera. Neither file has a lens distortion.
"""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from abs_service.commands.parts.camera_file import CameraFile, CameraFileError, ColorTable, DepthTable, Focal, Size
from abs_service.config.problems import from_pydantic
from calib.files import limited

#: Names of the file, in the order in which they are looked for.
NAMES = ("camera_intrinsic.json", "intrinsic.json")


class _Intrinsics(BaseModel):
    """The keys that are read; `intrinsic_matrix` is column by column, `depth_scale` units per metre."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    width: Size
    height: Size
    intrinsic_matrix: Annotated[tuple[FiniteFloat, ...], Field(min_length=9, max_length=9)]
    depth_scale: Focal | None = None


def load(folder: Path) -> CameraFile:
    """The camera of a folder, for both kinds of images.

    Raises:
        CameraFileError: there is no file with intrinsics, or it cannot be used.
    """
    path = next((folder / name for name in NAMES if (folder / name).exists()), None)
    if path is None:
        raise CameraFileError(f"{folder}: has neither {' nor '.join(NAMES)}; layout pairs takes a camera file instead")
    return read(path)


def read(path: Path) -> CameraFile:
    """The camera in a file with intrinsics; raises as `load`."""
    try:
        given = _Intrinsics.model_validate_json(limited.text(path))
        fx, _, _, _, fy, _, cx, cy, _ = given.intrinsic_matrix
        camera = {"width": given.width, "height": given.height, "fx": fx, "fy": fy, "cx": cx, "cy": cy}
        scale = None if given.depth_scale is None else 1 / given.depth_scale
        return CameraFile(depth=DepthTable(**camera, depth_scale=scale), color=ColorTable(**camera))
    except OSError as error:
        raise CameraFileError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        problems = "".join(f"\n  {problem}" for problem in from_pydantic(error, lambda key: ()))
        raise CameraFileError(f"{path}:{problems}") from None
    except ValueError as error:  # what is no UTF-8
        raise CameraFileError(f"{path}: cannot be understood: {error}") from None

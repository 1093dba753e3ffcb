"""Camera tables, which override factory calibrations."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from calib import pose
from calib.camera import MAX_SIDE_PX, Camera
from calib.lenses.by_name import LensName, lens_of
from calib.lenses.lens import Lens
from calib.pose import Pose

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Size = Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]
Focal = Annotated[FiniteFloat, Field(gt=0)]

#: A camera of which `applied_to` keeps nothing but the pose.
_REPLACED = Camera(1, 1, 1.0, 1.0, 0.0, 0.0)

_MATRIX = ("width", "height", "fx", "fy", "cx", "cy")


class PoseTable(BaseModel):
    """A pose: rotation vector [rad] and translation [m]. A 4 × 4 matrix, row by row, may stand in its place.

    Attributes:
        rotation_vector: axis of the rotation times its angle [rad].
        translation: position of the sensor's centre in the rig [m].
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rotation_vector: Vector = (0.0, 0.0, 0.0)
    translation: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="before")
    @classmethod
    def _from_matrix(cls, value: Any) -> Any:
        if isinstance(value, dict):
            # What a validator of this mode returns is no longer JSON to pydantic, where lists are not tuples.
            return {key: tuple(part) if isinstance(part, list) else part for key, part in value.items()}
        if not isinstance(value, list):
            return value
        try:
            T_ab = np.asarray(value, float)
        except ValueError:
            raise ValueError("a matrix has 4 rows of 4 numbers") from None
        if T_ab.shape != (4, 4) or not pose.is_pose(T_ab):
            raise ValueError(
                "not a pose: 4 rows of 4 numbers, an orthonormal rotation of determinant 1, last row 0 0 0 1"
            )
        rotation_vector, translation = pose.to_rotation_vector(T_ab)
        return {"rotation_vector": tuple(rotation_vector.tolist()), "translation": tuple(translation.tolist())}

    def matrix(self) -> Pose:
        """The pose as a matrix, shape (4, 4)."""
        return pose.from_rotation_vector(self.rotation_vector, self.translation)


class CameraTable(BaseModel):
    """Calibration that replaces the device's own: the image with its camera matrix and lens, the pose, or both.

    Attributes:
        width, height: image size [px]; these and the next four keys belong together.
        fx, fy: focal length [px].
        cx, cy: coordinate of the principal point [px].
        lens: coefficients of the distortion in OpenCV's order; missing ones are 0.
        lens_model: distortion that they are coefficients of: `brown_conrady` (k1, k2, p1, p2, k3 … k6) or
            `fisheye` (k1 … k4).
        T_rs: pose that maps sensor coordinates to rig coordinates.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: Size | None = None
    height: Size | None = None
    fx: Focal | None = None
    fy: Focal | None = None
    cx: FiniteFloat | None = None
    cy: FiniteFloat | None = None
    lens: Annotated[tuple[FiniteFloat, ...], Field(max_length=8)] | None = None
    lens_model: LensName | None = None
    T_rs: PoseTable | None = None

    @model_validator(mode="after")
    def _complete(self) -> "CameraTable":
        missing = [key for key in _MATRIX if getattr(self, key) is None]
        distorts = self.lens is not None or self.lens_model is not None
        if missing and (len(missing) < len(_MATRIX) or distorts):
            raise ValueError(
                f"{', '.join(_MATRIX)} belong together, with lens if it distorts; missing: {', '.join(missing)}"
            )
        lens_of(self.lens_model or Lens.name, self.lens or ())
        return self

    def own(self) -> Camera | None:
        """The camera that the table describes by itself; None if it leaves the camera matrix to the device."""
        return None if self.fx is None else self.applied_to(_REPLACED)

    def applied_to(self, factory: Camera) -> Camera:
        """The factory calibration, overridden by the table."""
        given = {key: getattr(self, key) for key in _MATRIX if getattr(self, key) is not None}
        if given:
            given["lens"] = lens_of(self.lens_model or Lens.name, self.lens or ())
        if self.T_rs is not None:
            given["T_rs"] = self.T_rs.matrix()
        return replace(factory, **given)

"""The camera file of `abs-service import`: which sensors took the images, as TOML or JSON."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from abs_service.config.positions import located
from abs_service.config.problems import Key, from_pydantic
from abs_service.config.tables.camera import PoseTable
from calib.camera import MAX_SIDE_PX, Camera
from calib.files import limited, nested
from calib.lenses.by_name import LensName, lens_of

Size = Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]
Focal = Annotated[FiniteFloat, Field(gt=0)]


class CameraFileError(Exception):
    """A camera file that cannot be used; names the file and each key that is wrong."""


class ColorTable(BaseModel):
    """The colour sensor: image size and camera matrix [px], lens distortion, pose in the rig."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: Size
    height: Size
    fx: Focal
    fy: Focal
    cx: FiniteFloat
    cy: FiniteFloat
    lens: Annotated[tuple[FiniteFloat, ...], Field(max_length=8)] = ()
    lens_model: LensName = "brown_conrady"
    T_rs: PoseTable = PoseTable()

    @model_validator(mode="after")
    def _is_lens(self) -> "ColorTable":
        lens_of(self.lens_model, self.lens)
        return self

    def camera(self) -> Camera:
        """The camera that the table describes."""
        return Camera(
            self.width,
            self.height,
            self.fx,
            self.fy,
            self.cx,
            self.cy,
            lens_of(self.lens_model, self.lens),
            self.T_rs.matrix(),
        )


class DepthTable(ColorTable):
    """The depth sensor.

    Attributes:
        depth_scale: length of one unit of the images [m]; None for the default of the layout.
        geometry: which length they hold.
        invalid: the value that means "no return".
    """

    depth_scale: Annotated[FiniteFloat, Field(gt=0)] | None = None
    geometry: Literal["z", "radial"] = "z"
    invalid: Annotated[int, Field(ge=0, le=65535)] = 0


class CameraFile(BaseModel):
    """A camera file: table `depth`, and table `color` if there are colour images."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    depth: DepthTable
    color: ColorTable | None = None


#: The default calibration that the TUM RGB-D benchmark recommends for all its sequences.
TUM = CameraFile(
    depth=DepthTable(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5),
    color=ColorTable(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5),
)


def load(path: Path) -> CameraFile:
    """Reads a camera file: JSON if its name ends in `.json`, TOML otherwise.

    Raises:
        CameraFileError: the file cannot be read, or has invalid keys or values.
    """
    toml = ""
    try:
        text = limited.text(path)
        toml = "" if path.suffix == ".json" else text
        content = nested.json(text) if path.suffix == ".json" else nested.toml(toml)
        # Through JSON, because there a list may stand for a tuple.
        return CameraFile.model_validate_json(json.dumps(content), strict=True)
    except OSError as error:
        raise CameraFileError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        problems = "".join(f"\n  {problem}" for problem in located(from_pydantic(error, _allowed_at), toml))
        raise CameraFileError(f"{path}:{problems}") from None
    except ValueError as error:  # what is no UTF-8, JSON or TOML
        raise CameraFileError(f"{path}: cannot be understood: {error}") from None


def _allowed_at(key: Key) -> Collection[str]:
    tables: Mapping[Key, type[BaseModel]] = {(): CameraFile, ("depth",): DepthTable, ("color",): ColorTable}
    return tables.get(key, PoseTable).model_fields

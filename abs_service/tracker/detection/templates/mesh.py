"""A triangle mesh from a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from abs_service.tracker.detection.templates import mesh_file
from abs_service.tracker.detection.templates.known_object import KnownObject

#: Length of the units [m].
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


@dataclass(frozen=True)
class Settings:
    """TOML keys of the template.

    Attributes:
        path: OBJ, PLY or STL file with the triangles of the object's surface.
        unit: unit of the file's coordinates.
    """

    path: Path
    unit: Literal["m", "cm", "mm"] = "m"

    def build(self, vertices: int) -> KnownObject:
        """The object with a mesh of about `vertices` vertices.

        Raises:
            DetectionError: the file is missing, or no mesh that can be tracked.
        """
        return mesh_file.load(self.path, UNITS[self.unit], vertices)

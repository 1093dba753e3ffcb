"""No template: the mesh is made from the first depth image."""

from dataclasses import dataclass

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.templates.base import ALL_SEEN, Model_co, ModelSettings, Sight


@dataclass(frozen=True)
class Settings:
    """TOML keys: none."""

    def build(self, vertices: int) -> "FirstImage":
        """The null object."""
        return FirstImage()


class FirstImage:
    """The model builds its mesh from the pixels of the object."""

    def bind(self, model: ModelSettings[Model_co], detection: InitialDetection) -> tuple[Model_co, Sight]:
        """The model of the detected surface."""
        return model.build(detection), ALL_SEEN

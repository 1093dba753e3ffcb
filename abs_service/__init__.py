"""Live deformation tracking from depth and colour cameras by analysis by synthesis.

  import abs_service as a

  camera = a.Camera(640, 480, fx=528, fy=528, cx=320, cy=240)
  tracker = a.Tracker(depth=camera, model=a.Nurbs())
  for number, depth_m in enumerate(images):
      estimate = tracker.track(depth_m, time_s=number / 30)

What `__all__` names is the public face (docs/reference/api.md), imported when it is first used;
nothing else is promised.
"""

from importlib import import_module

TYPE_CHECKING = False  # true for type checkers; importing typing would make --help slower
if TYPE_CHECKING:
    from typing import Any

    from abs_service.api import (
        ArgumentError,
        Camera,
        CameraError,
        ConfigError,
        Estimate,
        Fisheye,
        FlexPad,
        Gravity,
        Image,
        Lens,
        LensError,
        Nurbs,
        Posed,
        Recording,
        RecordingError,
        Rig,
        Rigid,
        Status,
        Tracker,
        load_rig,
        noise,
        open_recording,
    )

__version__ = "0.1.0"

__all__ = [
    "ArgumentError",
    "Camera",
    "CameraError",
    "ConfigError",
    "Estimate",
    "Fisheye",
    "FlexPad",
    "Gravity",
    "Image",
    "Lens",
    "LensError",
    "Nurbs",
    "Posed",
    "Recording",
    "RecordingError",
    "Rig",
    "Rigid",
    "Status",
    "Tracker",
    "load_rig",
    "noise",
    "open_recording",
]


def __getattr__(name: str) -> "Any":
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("abs_service.api"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""Images to record: of the simulated device, and of real cameras where there are recordings."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

from drivers.contract.frame import Frame
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.opening import open_recording
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import FIRST_MOVING, expose, simulate

#: Address of the rig of today: one depth camera and one colour camera.
RIG = "simulated://sheet?seed={seed}&sensors=tof,color,bayer"
SIZES = "&tof=640x480&color=1280x720&bayer=1280x720"


def simulated(seed: int, frames: int) -> list[LabeledExposure]:
    """Exposures of a moving sheet, by all sensors of `RIG`."""
    simulation = simulate(RIG.format(seed=seed) + SIZES)
    return expose(simulation, range(FIRST_MOVING, FIRST_MOVING + frames))


def streams(exposures: list[LabeledExposure]) -> dict[str, list[Frame]]:
    """Frames by what they are called in tables."""
    found: dict[str, list[Frame]] = {}
    for exposure in exposures:
        for (sensor, stream), frame in exposure.frames.frames.items():
            found.setdefault(f"simulated {sensor}/{stream}", []).append(frame)
    return found


def recorded(data: Path | None, frames: int) -> dict[str, list[Frame]]:
    """Frames of real cameras; those whose recordings or readers are missing are left out."""
    if data is None:
        return {}
    found: dict[str, list[Frame]] = {}
    for name, program, path in (
        ("RealSense", "realsense", data / "realsense_bag/single_depth_color_640x480.bag"),
        ("Azure Kinect", "azure", data / "tof_azure_kinect_pyk4a/recording.mkv"),
    ):
        try:
            for frame in islice(open_recording(program, path).frames(), 2 * frames):
                found.setdefault(f"{name} {frame.stream}", []).append(frame)
        except (ForeignRecordingError, FileNotFoundError):
            continue
    return found


def as_stream(frame: Frame, sensor: str, seq: int) -> Frame:
    """The frame as that of a sensor and exposure."""
    return replace(frame, sensor=sensor, seq=seq, t_host_ns=seq * 33_333_333)

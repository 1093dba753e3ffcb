"""One frame of an Azure Kinect: two cameras with the factory's calibration, warped into each other and tracked."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import abs_service as a
from abs_service.report.content import Column, Section, Table
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.regions import nearest
from calib.warp.pictures import PictureLookup
from drivers.contract.frame import Frame, Kind
from drivers.opening import open_recording
from evaluation.experiment import Findings, at_least, at_most
from evaluation.inputs.recordings.agreement import agreement

FOLDER = "tof_azure_kinect_pyk4a"

#: At which the one exposure is shown again and again.
RATE_HZ = 30.0

#: Shift that separates edges of the infra-red from edges of the colours [px].
SHIFT = 8

#: σ of this camera's distances within its range, by its data sheet at most [m].
SIGMA_M = 0.005

#: Smallest surface that the nearest one is looked for among [pixels].
MIN_PIXELS = 3000


@dataclass(frozen=True, eq=False)
class AzureExposure:
    """The first exposure: its frames by kind and the cameras by sensor."""

    frames: Mapping[Kind, Frame]
    cameras: Mapping[str, a.Camera]

    @property
    def distance(self) -> NDArray[np.float32]:
        """Radial distances of the depth camera (height, width) [m], NaN without return."""
        return self.frames[Kind.DEPTH].si() * self.cameras["depth"].lookup.ray_length.astype(np.float32)

    @property
    def amplitude(self) -> NDArray[np.float32]:
        """Amplitudes (height, width): infra-red with the camera's own light."""
        return self.frames[Kind.AMPLITUDE].si()

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """The colour camera's image (height, width, 3)."""
        return self.frames[Kind.COLOR].data[..., ::-1].astype(np.uint8)


def read(folder: Path) -> AzureExposure:
    """The frame in a folder with recording.mkv.

    Raises:
        ForeignRecordingError: it is not there or cannot be read, or PyAV is not installed.
    """
    footage = open_recording("azure", folder / "recording.mkv")
    frames: dict[Kind, Frame] = {}
    for frame in footage.frames():
        frames.setdefault(frame.kind, frame)
    return AzureExposure(frames, footage.cameras)


def edges_agree(exposure: AzureExposure) -> float:
    """Correlation of edges in amplitudes and in warped colours, over the best of four with shifted colours.

    Edges of the infra-red amplitudes are edges of the colours there, if distances and calibration are right.
    """
    sight = PictureLookup(exposure.cameras["depth"], exposure.cameras["color"]).look(exposure.distance)
    grey = sight.blended(exposure.rgb).mean(axis=-1)
    measured = np.isfinite(exposure.distance)

    def correlation(right: int, down: int) -> float:
        moved = np.roll(grey, (down, right), (0, 1))
        edges = [np.hypot(*np.gradient(np.log(image + 1))) for image in (moved, exposure.amplitude)]
        known = np.isfinite(edges[0]) & measured
        return float(np.corrcoef(edges[0][known], edges[1][known])[0, 1])

    moved = [correlation(*shift) for shift in ((SHIFT, 0), (-SHIFT, 0), (0, SHIFT), (0, -SHIFT))]
    return correlation(0, 0) / max(moved)


def findings(folder: Path) -> Findings:
    """Registration of colours and amplitudes, and residuals of a surface tracked on the repeated frame."""
    exposure = read(folder)
    ratio = edges_agree(exposure)
    depth, color = (exposure.cameras[name] for name in ("depth", "color"))
    tracker = a.Tracker(
        depth, a.Nurbs(6, 6), noise=a.noise.Constant(SIGMA_M), color=color,
        region={"type": "nearest", "minimum_pixels": MIN_PIXELS},
    )  # fmt: skip
    depth_m, image = exposure.frames[Kind.DEPTH].si(), exposure.rgb
    estimate = [tracker.track(depth_m, time_s=k / RATE_HZ, image=image) for k in range(3)][-1]
    if not len(estimate.faces):
        raise RuntimeError(", ".join(estimate.reasons))
    region = nearest.Settings(minimum_pixels=MIN_PIXELS).build()
    mask = region.select(DepthView.of(exposure.distance, depth))
    found = agreement(estimate.vertices, estimate.faces, exposure.distance, mask, depth)
    columns = (Column("nearest surface"), Column("pixels", format="d"), Column("forward", "mm", ".2f"))
    columns += (Column("backward", "mm", ".2f"), Column("covered", "%", ".1f"), Column("status"))
    row = (f"{np.median(exposure.distance[mask]):.2f} m away", int(mask.sum()), found.forward_mm, found.backward_mm)
    table = Table("A NURBS of 6 × 6 control points", columns, ((*row, 100 * found.covered, estimate.status.name),))
    text = f"Edges of the warped colours correlate {ratio:.2f} times as well with the amplitudes' as {SHIFT} px aside."
    return Findings(
        (
            at_least("Azure Kinect: colours meet amplitudes, over those moved by 8 px", ratio, 1.3),
            at_most("Azure Kinect: forward residual, median", found.forward_mm, 1e3 * SIGMA_M, "mm"),
        ),
        (Section("Azure Kinect: one frame", (text, table)),),
        {"azure": {"edges": ratio, "forward_mm": found.forward_mm, "backward_mm": found.backward_mm}},
    )

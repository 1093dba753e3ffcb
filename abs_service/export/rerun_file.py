"""A recording for the viewer Rerun: mesh, points, images, cameras and plots on one timeline; needs rerun-sdk."""

import os
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from abs_service.api.estimate import Estimate
from abs_service.api.recording import Recording
from abs_service.display.page.pictures import cloud, picture, radial
from abs_service.export import table
from abs_service.pairing.observation import ObservationError
from abs_service.pairing.points import z_image
from abs_service.wire.estimate_messages import State
from abs_service.wire.viewer_messages import COLORS, ViewRate
from calib.camera import Camera
from calib.lenses.lens import LensError
from calib.pose import to_quaternion
from drivers import replay
from drivers.contract.frame import Frame, Kind
from drivers.replay import RecordingError

#: The timeline: seconds on the clock of the images.
TIMELINE = "time"

JPEG_QUALITY = 90

#: Colour and radius of measured points [px], which lie around the mesh and leave it in sight.
POINT, POINT_PX = (110, 130, 170), 0.7

_COLORS = {State.Status.Name(status).removeprefix("STATUS_"): color for status, color in COLORS.items()}
_LEVELS = {"DEGRADED": "WARN", "LOST": "ERROR"}


def write(
    recording: Recording,
    estimates: Mapping[str, Iterable[Estimate]],
    path: Path,
    view_hz: float,
    advance: Callable[[], None],
) -> tuple[int, tuple[str, ...]]:
    """Writes an RRD file; returns the number of images and estimates, and what is a picture only. See `RerunFile`.

    Args:
        recording: its images and cameras, if there are any.
        estimates: by tracker.
        path: of the file.
        view_hz: largest rate of the points of a sensor [Hz]; 0 for none.
        advance: called for each image and estimate.

    Raises:
        RecordingError: a part of the recording is damaged.
        OSError: the file cannot be written.
    """
    file = RerunFile(path, view_hz)
    written = 0
    try:
        cameras, frames = recording.cameras, replay.Recording(recording.path).images()
    except RecordingError:  # there are no images, as in what `abs-service replay` writes
        cameras, frames = {}, ()
    for sensor, camera in cameras.items():
        file.add_camera(sensor, camera)
    for frame in frames:
        file.add_frame(frame.at_middle(), cameras.get(frame.sensor))
        written += 1
        advance()
    for tracker, found in estimates.items():
        for estimate in found:
            file.add_estimate(tracker, estimate)
            written += 1
            advance()
    file.finish()
    return written, tuple(file.notes.values())


class RerunFile:
    """Writes `/cameras/SENSOR`, `/images/SENSOR/STREAM`, `/points/SENSOR`, `/TRACKER/mesh`, and plots.

    Poses and points are in the frame of the rig [m]. Depth images are metres along the optical axis, 0 without return;
    colour is JPEG; other images have the sensor's values.

    Args:
        path: of the file.
        view_hz: largest rate of the points of a sensor [Hz]; 0 for none.

    Attributes:
        notes: depth images that are pictures only, and why.
    """

    def __init__(self, path: Path, view_hz: float) -> None:
        self.notes: dict[str, str] = {}
        self._stream = rr.RecordingStream("abs-service")
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._output = _Output(path)
        self._stream.save(self._output.pipe)
        self._output.begin()
        self._view_hz = view_hz
        self._rates: dict[str, ViewRate] = {}
        self._images: set[str] = set()
        self._plots: set[str] = set()
        self._stream.log("/", rr.ViewCoordinates.RDF, static=True)

    def add_camera(self, sensor: str, camera: Camera) -> None:
        """Adds pose and field of view of a camera, without its distortion."""
        name = f"/cameras/{sensor}"
        turn = rr.Quaternion(xyzw=to_quaternion(camera.T_rs))
        self._stream.log(name, rr.Transform3D(translation=camera.T_rs[:3, 3], quaternion=turn), static=True)
        matrix = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
        shape = rr.Pinhole(
            image_from_camera=matrix,
            resolution=(camera.width, camera.height),
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=0.1,
        )
        self._stream.log(name, shape, static=True)

    def add_frame(self, frame: Frame, camera: Camera | None) -> None:
        """Adds an image, and points if it is one of depth."""
        name = f"/images/{frame.sensor}/{frame.stream}"
        self._images.add(name)
        self._stream.set_time(TIMELINE, duration=frame.t_host_ns * 1e-9)
        if frame.kind == Kind.DEPTH:
            self._add_depth(name, frame, camera)
        elif frame.kind in (Kind.COLOR, Kind.BAYER):
            self._stream.log(name, rr.Image(picture(frame)).compress(jpeg_quality=JPEG_QUALITY))
        else:
            self._stream.log(name, rr.Image(frame.data, color_model="L"))

    def add_estimate(self, tracker: str, estimate: Estimate) -> None:
        """Adds mesh, status and numbers of an estimate."""
        self._stream.set_time(TIMELINE, duration=estimate.time_s)
        status = estimate.status.value
        if len(estimate.faces):
            color = _COLORS[status]
            mesh = rr.Mesh3D(
                vertex_positions=estimate.vertices, triangle_indices=estimate.faces, albedo_factor=[*color, 1.0]
            )
            self._stream.log(f"/{tracker}/mesh", mesh)
        else:
            self._stream.log(f"/{tracker}/mesh", rr.Clear(recursive=False))
        text = f"{status}: {'; '.join(estimate.reasons)}" if estimate.reasons else status
        self._stream.log(f"/{tracker}/status", rr.TextLog(text, level=_LEVELS.get(status, "INFO")))
        numbers = {"deviation_m": table.deviation_m(estimate), "inlier_share": estimate.inlier_share}
        for name, value in numbers.items():
            self._stream.log(f"/{tracker}/{name}", rr.Scalars(value))
            self._plots.add(f"/{tracker}/{name}")

    def finish(self) -> None:
        """Writes the layout of the views and the remaining data.

        Raises:
            OSError: the file cannot be written.
        """
        space = rrb.Spatial3DView(origin="/", contents=["+ /**", "- /images/**"], name="rig")
        images = [rrb.Spatial2DView(origin=name, name=name.removeprefix("/images/")) for name in sorted(self._images)]
        plots = [rrb.TimeSeriesView(origin=name, name=name[1:]) for name in sorted(self._plots)]
        columns = [rrb.Vertical(space, rrb.TextLogView(origin="/"), row_shares=[3, 1])]
        columns += [rrb.Vertical(*views) for views in (images, plots) if views]
        self._stream.send_blueprint(rrb.Blueprint(rrb.Horizontal(*columns)))
        self._stream.disconnect()
        self._output.finish()

    def _add_depth(self, name: str, frame: Frame, camera: Camera | None) -> None:
        try:
            if camera is None:
                raise ObservationError("no camera is recorded")
            z = z_image(frame, camera)
            rate = self._rates.setdefault(frame.sensor, ViewRate(self._view_hz))
            points = cloud(radial(frame, camera), camera)[0] if rate.due(frame.t_host_ns) else None
        except (ObservationError, LensError) as error:
            self.notes[name] = f"{name} is a picture without metres, and without points: {error}"
            self._stream.log(name, rr.Image(picture(frame)).compress(jpeg_quality=JPEG_QUALITY))
            return
        self._stream.log(name, rr.DepthImage(np.nan_to_num(z), meter=1.0))
        if points is not None:
            self._stream.log(
                f"/points/{frame.sensor}", rr.Points3D(points, colors=POINT, radii=rr.Radius.ui_points(POINT_PX))
            )


class _Output:
    """A file that Rerun writes through a pipe.

    What Rerun writes by itself to a disk that is full, it ends as if all were well, or never.

    Attributes:
        pipe: path of the pipe's end for Rerun.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._read, self._write = os.pipe()
        self.pipe = f"/proc/self/fd/{self._write}"
        self._thread = threading.Thread(target=self._copy, name="rerun file", daemon=True)
        self._failure: OSError | None = None

    def begin(self) -> None:
        """Begins to write the file; Rerun has opened its end."""
        os.close(self._write)
        self._thread.start()

    def finish(self) -> None:
        """Closes the file, after Rerun has closed its end.

        Raises:
            OSError: it could not be written.
        """
        self._thread.join()
        if self._failure is not None:
            raise self._failure

    def _copy(self) -> None:
        """Reads to the end, also when nothing can be written any more: Rerun would wait."""
        with open(self._read, "rb", buffering=0) as pipe:
            try:
                with self._file:
                    while data := pipe.read(1 << 20):
                        self._file.write(data)
            except OSError as error:
                self._failure = error
            while pipe.read(1 << 20):
                pass

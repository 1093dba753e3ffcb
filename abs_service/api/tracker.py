"""A tracker of arrays: one call per frame, no process, no file, no thread."""

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Literal

from numpy.typing import ArrayLike

from abs_service.api import arguments, checks
from abs_service.api import noise as noise_models
from abs_service.api.arguments import ModelPart, NoisePart, Table
from abs_service.api.arrays import object_mask
from abs_service.api.blas import one_blas_thread
from abs_service.api.checks import ArgumentError
from abs_service.api.estimate import Estimate, with_mesh
from abs_service.api.replayable import Replayable
from abs_service.api.tracker_parts import TrackerParts, tracker_parts
from abs_service.pairing.observation import ObservationError
from abs_service.tracking.observer import missing_streams
from abs_service.tracking.tracked_sets import TrackedSet, track_sets
from abs_service.tracking.warmup.board import warm_up
from calib.camera import Camera
from drivers.contract.frame import FrameSet
from drivers.replay import Recording


class Tracker:
    """Finds an object in depth images, then estimates its deformation, frame by frame.

    The first frame of an installation compiles the kernels, which takes up to a minute; see `warm_up`.

    Args:
        depth: camera of the depth images.
        model: deformation model: `Nurbs(4, 4)`, `FlexPad()`, `Gravity()`, `Rigid()` or `Posed(…)`.
        noise: noise model of the depths, one of `noise`; None: `noise.StructuredLight()`, a Kinect v1. A sensor that is
            much noisier than its model is found out in the image that the mesh is made from.
        color: camera of the colour images with its pose `T_rs`, which maps its coordinates to those of the rig.
        color_noise: `noise.Color()`, `noise.Grey()` or `noise.Bayer()`; None: `noise.Color()`.
        texture: noise model of the amplitudes, `noise.Intensity("amplitude", …)`, if they are to be tracked as a
            picture of the surface.
        range_m: largest distance that the depth camera can report.
        outlier_share: share of the depths that come from anywhere.
        no_return: probability of no return from a surface, `{"share": 0.02, "per_m": 0.5, "grazing": 3.0}`.
        vertices: about how many vertices the mesh has.
        region: where the object is in the first frame, unless `track` is given a mask.
        template: what is known of its shape: `{"type": "sheet", "size": (0.297, 0.21)}`, `{"type": "mesh", "path": …}`.
        synthesis, objective, optimizer, priors, vertex_offsets, status, reinitialization: tables like those of a
            tracker in a rig file, as are `region` and `template`: `priors={"stretch": 0.1}`.
        budget_evaluations: how often a search may compute the cost of a candidate per frame.
        budget_ms: time that a search may take [ms]; None: as long as it needs, with equal results from equal images.
        geometry: length in depth images: "z" along the optical axis, or "radial" from the camera centre.
        bayer: order of the colour filters in the upper left corner of a Bayer mosaic, row by row.

    None stands for the default of a rig file, wherever nothing else is said.

    Raises:
        ArgumentError: an argument that cannot be used.
    """

    def __init__(
        self,
        depth: Camera,
        model: ModelPart,
        *,
        noise: NoisePart | None = None,
        color: Camera | None = None,
        color_noise: NoisePart | None = None,
        texture: NoisePart | None = None,
        range_m: float | None = None,
        outlier_share: float | None = None,
        no_return: Table | None = None,
        vertices: int | None = None,
        region: Table | None = None,
        template: Table | None = None,
        synthesis: Table | None = None,
        objective: Table | None = None,
        optimizer: Table | None = None,
        priors: Table | None = None,
        vertex_offsets: Table | None = None,
        status: Table | None = None,
        reinitialization: Table | None = None,
        budget_evaluations: int | None = None,
        budget_ms: float | None = None,
        geometry: Literal["z", "radial"] = "z",
        bayer: Literal["rggb", "bggr", "grbg", "gbrg"] = "rggb",
    ):
        if color is None and color_noise is not None:
            raise ArgumentError(f"color_noise = {color_noise}: must be None without the camera, color=Camera(…)")
        sensor = {"noise": noise_models.StructuredLight() if noise is None else noise, "texture": texture}
        sensor |= {"range_m": range_m, "outlier_share": outlier_share, "no_return": no_return}
        parts = {"model": model, "region": region, "template": template, "synthesis": synthesis, "objective": objective}
        parts |= {"optimizer": optimizer, "priors": priors, "vertex_offsets": vertex_offsets, "status": status}
        parts |= {"reinitialization": reinitialization, "budget_evaluations": budget_evaluations}
        cameras = {arguments.DEPTH: checks.camera("depth", depth)}
        if color is not None:
            cameras[arguments.COLOR] = checks.camera("color", color)
            color_noise = noise_models.Color() if color_noise is None else color_noise
        settings = arguments.configuration(sensor, color_noise, parts, vertices)
        self._parts = tracker_parts(settings, arguments.TRACKER, cameras, geometry, bayer, budget_ms)

    def track(
        self,
        depth_m: ArrayLike | None = None,
        *,
        time_s: float,
        image: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        deviation_m: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        streams: Mapping[str, ArrayLike] | None = None,
    ) -> Estimate:
        """The estimate for the images of one moment.

        Args:
            depth_m: distances (height, width) [m], floating-point; NaN, infinity or 0 means no return.
            time_s: the moment [s]; later than that of the frame before.
            image: of the colour camera: (height, width, 3) red, green, blue as uint8; one channel, (height, width), if
                its noise model is `Grey` (uint8 or uint16) or `Bayer` (uint8).
            amplitude: amplitudes of a time-of-flight camera (height, width), if a noise model depends on them.
            deviation_m: σ of every distance (height, width) [m], if the noise model is `Measured`.
            mask: pixels of the object (height, width) in `depth_m`, boolean or not zero. It counts where the object is
                looked for: in the first frame, and after it was lost.
            streams: images of a rig's further sensors, by "sensor/stream".

        Raises:
            ArgumentError: an array that does not fit, that nothing uses or that is missing; a time that is not later.
        """
        given = {"depth_m": depth_m, "image": image, "amplitude": amplitude, "deviation_m": deviation_m}
        parts = self._parts
        parts.region.mask = None if mask is None else object_mask(mask, parts.camera)
        further = {} if streams is None else checks.mapping("streams", streams, '{"left/depth": array}')
        frames = parts.frames.frame_set(time_s, given | dict(further))
        estimate = next(self._track([frames]))
        # A tracker that has lost its object advises to bring it back; here it is the image that is to blame.
        reasons = estimate.reasons and parts.frames.without_return(frames)
        return replace(estimate, reasons=(*reasons, *estimate.reasons)) if reasons else estimate

    def replay(self, recording: Replayable) -> Iterator[Estimate]:
        """The estimates for a recording, frame set by frame set, as `abs-service replay` makes them.

        Args:
            recording: what `open_recording` opens.

        Raises:
            ArgumentError: no recording, or one that lacks images that the tracker uses.
            RecordingError: a part of the file is damaged.
        """
        if not isinstance(recording, Replayable):
            raise ArgumentError(f"recording = {recording!r}: must be a recording, open_recording(path)")
        if missing := missing_streams(self._parts.rig.sensors.values(), recording.streams):
            lacking = f"recording = {recording.path}: must have {', '.join(missing)}"
            raise ArgumentError(f"{lacking}; it has {', '.join(recording.streams)}")
        self._parts.region.mask = None
        frames = Recording(recording.path).images()
        return self._track(self._parts.synchroniser().group(frames))

    def reinitialize(self) -> None:
        """Looks for the object anew in the next frame; safe from any thread."""
        self._parts.session.reinitialize()

    def warm_up(self) -> None:
        """Compiles the kernels on all cores: up to a minute once per installation, then about a second per process."""
        warm_up(self._parts.rig, self._parts.plan)

    def _track(self, frame_sets: Iterable[FrameSet]) -> Iterator[Estimate]:
        tracked = track_sets(self._parts.session, frame_sets, time.monotonic_ns, self._parts.budget_ns)
        try:
            while (found := self._next(tracked)) is not None:
                yield found
        except ObservationError as error:
            raise ArgumentError(str(error)) from None

    def _next(self, tracked: Iterator[TrackedSet]) -> Estimate | None:
        session = self._parts.session
        with one_blas_thread:
            one = next(tracked, None)
            return one and with_mesh(one.estimate, session.mesh, session.mesh_version)


def tracker_of(parts: TrackerParts) -> Tracker:
    """A tracker that a rig file describes, in place of arguments."""
    tracker = Tracker.__new__(Tracker)
    tracker._parts = parts  # noqa: SLF001
    return tracker

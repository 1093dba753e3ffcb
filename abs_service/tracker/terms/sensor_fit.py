"""Agreement of one sensor with one deformed mesh."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.vertex_counts import VertexCounts, VertexMasks
from calib.noise.fit.truncation import deviation_within

#: Residuals up to this many deviations count as explained by the sensor's noise.
INLIER_DEVIATIONS = 3.0

#: With fewer vertices on the free edges, their shares say nothing.
MIN_RIM = 8


@dataclass(frozen=True, slots=True)
class RimFit:
    """Numbers of rim vertices of a mesh by class, from the depth image beside them.

    Attributes:
        visible: on free edges, not behind an occluder, in a hole or behind the mesh's own surface.
        outside: of these, beside the object: the mesh hangs over the outline.
        inside: of these, far inside the outline: measured surface of the object continues beyond the mesh.
        off_m: distance of the visible ones from the outline [m], see `displacement` and `motion` in `rim_motion`; ∞ if
            the mesh has slid by an unknown distance.
        occluded: on free edges, but not visible.
        covered: on edges that something hid in the first image, or that its border cut.
        uncovered: of these, measured surface of the object now continues beyond the mesh.
        classes: a byte for each vertex of the mesh (n,): 0 inside it or unknown, else 1 and its `RimClass`; none if no
            outline is known.
        lost: number of those outside that are in an area that the sensor has lost, without return.
    """

    visible: int = 0
    outside: int = 0
    inside: int = 0
    off_m: float = 0.0
    occluded: int = 0
    covered: int = 0
    uncovered: int = 0
    classes: bytes = b""
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Remainder:
    """Measured surface that continues from the object beyond the mesh, as a share of this surface and the mesh, 0…1.

    Attributes:
        share: in this image; NaN for a sensor that measures no distances, or if it does not show the object.
        at_first: in the first image, in which the mesh is right: an object in contact continues in others.
    """

    share: float = float("nan")
    at_first: float = float("nan")

    @property
    def gained(self) -> float:
        """Increase of the share since the first image, not below 0; 0 if unknown."""
        return max(0.0, self.share - self.at_first)  # of NaN and 0.0, the first


@dataclass(frozen=True, slots=True)
class SensorFit:
    """Agreement of one sensor with one deformed mesh.

    Attributes:
        sensor: its name.
        visible: number of vertices that face the sensor and lie inside its image without a known occluder, and whose
            appearance is known if it measures that.
        occluded: number of vertices behind the mesh's own surface, behind an occluder, or in a hole of the measurement;
            those that are turned away, such as the back of a body, are neither.
        samples: number of visible vertices with a measurement.
        inliers: number of samples that their noise explains.
        mean_log_likelihood: minus the mean cost of a vertex; a log-likelihood if the objective is a likelihood.
        normalized_residual: standard deviation of the normalised residuals, estimated from the inliers: 1 if the noise
            model is right, 2 if its σ is half the true one; NaN without inliers or without a noise model.
        rim: agreement of the mesh's edges with the outline; zeros for a sensor that measures no distances.
        counts: the vertices by what the sensor's image shows of them; zeros for a light barrier.
        remainder: measured surface of the object that the mesh leaves unexplained.
        is_surprised: True for a sensor of distances in whose image nothing was where the object was expected: neither
            the outline nor what lies beside the mesh is known.
    """

    sensor: str
    visible: int
    occluded: int
    samples: int
    inliers: int
    mean_log_likelihood: float
    normalized_residual: float
    rim: RimFit = RimFit()
    counts: VertexCounts = field(default_factory=VertexCounts)
    remainder: Remainder = Remainder()
    is_surprised: bool = False

    def without_back(self) -> "SensorFit":
        """The agreement of a mesh of which a part has always been turned away."""
        return replace(self, counts=replace(self.counts, turned_away=0))


def summarize(
    sensor: str,
    masks: VertexMasks,
    measured: NDArray[np.bool_],
    residual: NDArray[np.float64],
    mean_log_likelihood: float,
    channels: int = 1,
) -> SensorFit:
    """Summary of per-vertex arrays (n,).

    Fitting theta reduces the residuals by a few per cent; this is not corrected.

    Args:
        sensor: its name.
        masks: what the sensor's image shows of the vertices.
        measured: mask of the vertices with a measurement.
        residual: absolute normalised residual, root mean square over the channels.
        mean_log_likelihood: see `SensorFit`.
        channels: number of values per measurement.
    """
    tally, squares = masks.tally(measured, residual, INLIER_DEVIATIONS)
    square = squares / tally.inliers if tally.inliers else float("nan")
    return SensorFit(
        sensor,
        visible=tally.visible,
        occluded=tally.occluded,
        samples=tally.samples,
        inliers=tally.inliers,
        mean_log_likelihood=mean_log_likelihood,
        normalized_residual=deviation_within(square, INLIER_DEVIATIONS, channels),
        counts=tally.of(len(measured)),
    )

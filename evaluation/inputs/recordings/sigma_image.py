"""One frame of an ifm O3R: value in the likelihood of the σ that the sensor reports for every pixel.

Cross-validation: a tenth of the pixels is held out, a NURBS is fitted to each large surface of the frame under each
noise model, and the likelihood of the held-out pixels is evaluated with the mesh as the true surface. The parameters of
the noise models are fitted by maximum likelihood to the residuals of the other pixels from local planes.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import abs_service as a
from abs_service.tracker.detection.segments.depth_segments import connected_surfaces
from abs_service.tracker.synthesis.rasterization.raster import Raster
from calib.noise import constant, measured
from calib.noise.base import DepthNoise
from calib.noise.fit import quality
from calib.noise.fit.quality import Quality
from calib.noise.fit.samples import Samples, from_images
from calib.sequences import plane_residuals
from drivers.contract.frame import Frame, Kind
from drivers.o3r.buffers import SENSOR, O3rBuffers

#: Neighbouring pixels whose distances differ by more show different surfaces [m].
MAX_STEP_M = 0.015
#: Surfaces with fewer pixels are left out.
MIN_PIXELS = 700
#: One pixel in so many is hidden.
PARTS = 10

#: The box has edges that a smaller margin does not reach around.
MODEL = a.Nurbs(6, 6, margin=0.2)
#: The mesh begins where the frame says; there is nothing to look for farther away.
SEARCH = {"type": "hybrid", "restarts": 0}

#: The noise models that are compared.
Noise = constant.Constant | measured.Measured

CLAIMED = "the sensor's own σ as it is"
ONE = "one σ for all pixels"
FITTED = "the sensor's own σ, with factor and floor"


@dataclass(frozen=True, eq=False)
class O3rExposure:
    """The frames of one exposure by what they hold, and what took them."""

    frames: Mapping[Kind, Frame]
    camera: a.Camera

    def image(self, kind: Kind) -> NDArray[np.float64]:
        """One of them (height, width) in SI units, NaN without return."""
        return self.frames[kind].si().astype(np.float64)


@dataclass(frozen=True)
class Row:
    """A noise model, and its agreement with pixels that nothing was fitted to."""

    name: str
    model: DepthNoise
    quality: Quality
    pixels: int


def read(folder: Path) -> O3rExposure:
    """The frame."""
    buffers = O3rBuffers(folder / "O3RBuffer.data")
    return O3rExposure({frame.kind: frame for frame in buffers.frames()}, buffers.cameras[SENSOR])


def compared(exposure: O3rExposure, generator: np.random.Generator, rounds: int) -> list[Row]:
    """Every noise model's agreement with hidden pixels.

    Args:
        exposure: the frame.
        generator: draws which pixels are hidden.
        rounds: how often another tenth of them is, at most ten.
    """
    part = generator.permuted(np.arange(exposure.image(Kind.DEPTH).size) % PARTS).reshape(
        exposure.image(Kind.DEPTH).shape
    )
    found: dict[str, list[tuple[DepthNoise, Samples]]] = {}
    for hidden in range(rounds):
        seen = _without(exposure, part == hidden)
        for name, model in noises(seen).items():
            for samples in _hidden(seen, model, exposure):
                found.setdefault(name, []).append((model, samples))
    return [_row(name, results) for name, results in found.items()]


def _row(name: str, results: list[tuple[DepthNoise, Samples]]) -> Row:
    model = results[-1][0]
    judged = [(quality.goodness_of_fit(one, samples), len(samples)) for one, samples in results]
    weights = np.array([count for _, count in judged])
    names = ("log_likelihood", "outlier_share", "variance", "within_one", "within_95")
    means = [float(np.average([getattr(one, key) for one, _ in judged], weights=weights)) for key in names]
    return Row(name, model, Quality(*means), int(weights.sum()))


def noises(exposure: O3rExposure) -> dict[str, Noise]:
    """The noise models, fitted to how pixels deviate from planes through their neighbours."""
    distance, own = exposure.image(Kind.DEPTH), exposure.image(Kind.DEVIATION)
    aside = plane_residuals.normalized(distance, np.ones_like(distance), exposure.camera.rays())
    samples = from_images(distance, distance - aside, own)
    fitted = measured.fit(samples)
    return {CLAIMED: measured.Measured(), ONE: replace(constant.fit(samples), offset=0.0), FITTED: fitted}


def _without(exposure: O3rExposure, hidden: NDArray[np.bool_]) -> O3rExposure:
    depth = exposure.frames[Kind.DEPTH]
    data = np.where(hidden, depth.data.dtype.type(0), depth.data)
    return replace(exposure, frames={**exposure.frames, Kind.DEPTH: replace(depth, data=data)})


def _hidden(seen: O3rExposure, noise: Noise, whole: O3rExposure) -> Iterator[Samples]:
    """Pixels of every surface that the tracker did not see, with its mesh as the true surface."""
    labels = connected_surfaces(seen.frames[Kind.DEPTH].si(), MAX_STEP_M).labels
    sizes = np.bincount(labels.ravel())
    distance, own = whole.image(Kind.DEPTH), whole.image(Kind.DEVIATION)
    unseen = ~np.isfinite(seen.image(Kind.DEPTH)) & np.isfinite(distance) & np.isfinite(own)
    for label in np.flatnonzero(sizes >= MIN_PIXELS)[1:]:
        found = _rendered(seen, noise, labels == label)
        there = unseen & np.isfinite(found)
        yield from_images(np.where(there, distance, np.nan), found, own).take(there.ravel())


def _rendered(exposure: O3rExposure, noise: Noise, surface: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Radial distances (height, width) [m] of the mesh that the tracker makes of some pixels; NaN beside it."""
    tracker = a.Tracker(exposure.camera, MODEL, noise=noise, vertices=300, optimizer=SEARCH, geometry="radial")
    own = exposure.image(Kind.DEVIATION) if noise.uses_amplitude else None
    estimate = tracker.track(exposure.image(Kind.DEPTH), time_s=0.0, deviation_m=own, mask=surface)
    if not len(estimate.faces):
        raise RuntimeError(f"{np.count_nonzero(surface)} pixels: {', '.join(estimate.reasons)}")
    image = Raster(exposure.camera, estimate.faces).render(np.ascontiguousarray(estimate.vertices.T))
    return np.where(np.isfinite(image), image, np.nan).astype(np.float64)

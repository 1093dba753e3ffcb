"""One frame of a depth sensor: cost, residuals and agreement of deformed meshes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import ObservedView, Synthesis
from abs_service.tracker.terms.base import Bounds, facing
from abs_service.tracker.terms.depth.depth_cost import FREE_SCALE_M, DepthResiduals, depth_cost, normalize
from abs_service.tracker.terms.depth.fluctuation import Fluctuation
from abs_service.tracker.terms.depth.outline.base import ObservedOutline
from abs_service.tracker.terms.depth.pixel_classes import UNKNOWN, PixelClasses
from abs_service.tracker.terms.depth.texels import Texels
from abs_service.tracker.terms.gradients import color_rows, depth_rows
from abs_service.tracker.terms.linearization import Part, PointLinearization, of_anything
from abs_service.tracker.terms.places.keypoints import NOTHING_RECOGNIZED, Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.sensor_fit import Remainder, SensorFit, summarize
from calib.jit import kernel

#: Nearer to the object than this, a sample in free space is pulled back no more stiffly [m].
MIN_FREE_M = 0.005

#: A measurement that is farther from its vertex is no measurement of the object [m].
MAX_MISFIT_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class ObservedDepth:
    """−log φ of eqs. 18 and 19 in one frame, see `ObservedTerm`.

    Attributes:
        sensor: name of the sensor.
        view: of the mesh in its camera.
        bounds: costs of the outlier model.
        texels: the noise model, rendered over the image.
        missing: cost (1, n) of a missing return at each vertex beyond that of an inlier.
        classes: of the pixels.
        occluders: points (k, 3) [m] before the predicted mesh.
        outline: end of the object in the image.
        remainder: measured surface that a mesh leaves unexplained.
        fluctuation: of the sensor's distances, for later frames.
        scale: of the noise model's deviations in this frame, from the fluctuation in earlier ones.
        is_surprised: nothing in the image agrees with the prediction.
        residuals: of the samples of a synthesis, for descent, fit and misfit.
        misfits: of a surface, for covariance and learning.
    """

    sensor: str
    view: ObservedView
    bounds: Bounds
    texels: Texels
    missing: NDArray[np.float32]
    classes: PixelClasses
    occluders: NDArray[np.float64]
    outline: ObservedOutline
    remainder: Callable[[Surface], Remainder]
    fluctuation: Fluctuation
    scale: float
    is_surprised: bool
    residuals: Memo[Synthesis, DepthResiduals] = field(init=False, default_factory=Memo[Synthesis, DepthResiduals])
    misfits: Memo[Surface, NDArray[np.float64]] = field(init=False, default_factory=Memo[Surface, NDArray[np.float64]])

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log φ (population,) plus the cost of the outline."""
        return self._measured_cost(self.view.synthesize(surface)) + self.outline.cost(surface)

    def _measured_cost(self, seen: Synthesis) -> NDArray[np.float64]:
        """Cost (population,) of the distances; the density is the larger of inlier and outlier density."""
        out = np.empty(len(seen.pixel))
        missing = seen.interpolation.carry(self.missing)
        texture = self.texels.at(seen.pixel)
        depth_cost(seen.pixel, seen.distance, missing, texture, self.bounds.inlier, self.bounds.outlier, out)
        return seen.interpolation.balance(out, self.bounds.unseen)

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of inliers and of samples in free space, and their derivatives with respect to Θ."""
        seen = self.view.synthesize(surface)
        samples = seen.interpolation.follow(sparse_jacobian)
        measured, free = (each(surface, samples, seen) for each in (self._linearize_measured, self._linearize_free))
        return [measured, free, self.outline.linearize(surface, sparse_jacobian)]

    def _linearize_measured(self, surface: Surface, samples: SparseJacobian, seen: Synthesis) -> PointLinearization:
        found = self.residuals.get(seen, self._residuals)
        use = (found.cost < self.bounds.outlier - self.bounds.inlier).nonzero()[0]
        vertices, normals = (
            seen.interpolation.spread(values) for values in (surface.vertices[0].T, surface.normals[0].T)
        )
        rows = depth_rows(vertices, normals, self.view.camera.center, use, found.inverse_deviation)
        return PointLinearization(found.normalized[use], rows, use, samples, vertices)

    def _linearize_free(self, surface: Surface, samples: SparseJacobian, seen: Synthesis) -> PointLinearization:
        """Residuals of samples in free space, which stop a thin sheet from sliding along itself.

        The cost d / s of a sample that is d from the object is replaced by a square of the same slope, ½ d² / (s d₀).
        """
        pixel, free_m = seen.pixel[0], self.classes.free_m
        away = free_m.ravel()[pixel].astype(np.float64)
        out = (pixel > 0) & (away > 0)
        if not out.any():
            return PointLinearization.empty(samples)
        vertices = seen.interpolation.spread(surface.vertices[0].T)
        distances = np.ascontiguousarray(free_m[1:-1, 1:-1, None])
        weight = 1 / np.sqrt(FREE_SCALE_M * np.maximum(away[out], MIN_FREE_M))
        rows = color_rows(distances, self.view.camera, vertices[out])[:, 0] * weight[:, None]
        return PointLinearization(away[out] * weight, rows, out.nonzero()[0], samples, vertices, of_surface=of_anything)

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self.view.synthesize(surface)
        residual, _, cost = self.residuals.get(seen, self._residuals)
        masks, free = self.classes.of_samples(seen.pixel[0], facing(seen, surface, self.view.camera.center))
        mean = -float(self._measured_cost(seen)[0]) / residual.size
        size = np.where(free, np.inf, np.abs(residual))
        found = summarize(self.sensor, masks, (cost < np.inf) | free, size, mean)
        return replace(
            found,
            normalized_residual=found.normalized_residual * self.scale,  # by the model as it is stated
            rim=self.outline.fit(surface),
            remainder=self.remainder(surface),
            is_surprised=self.is_surprised,
        )

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """Residuals of the outermost vertices, if the outline is beside the mesh; there is no other appearance."""
        return self.outline.match(surface, sparse_jacobian)

    @property
    def recognized(self) -> Recognized:
        """No keypoints: distances have none."""
        return NOTHING_RECOGNIZED

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurement, and the deviation of that by noise (2, n) [m].

        In free space it is that from the object, without noise. Zero where nothing is measured, and everywhere if the
        samples of the synthesis are not the vertices.
        """
        return self.misfits.get(surface, self._misfit)

    def _misfit(self, surface: Surface) -> NDArray[np.float64]:
        seen = self.view.synthesize(surface)
        if seen.pixel.shape[1] != surface.vertices.shape[2]:
            return np.zeros((2, 1))
        found = np.zeros((2, seen.pixel.shape[1]))
        classes = self.classes.bits.ravel(), self.classes.free_m.ravel()
        write_misfit(seen.pixel[0], self.residuals.get(seen, self._residuals), *classes, found)
        return found

    def learn(self, surface: Surface) -> None:
        """Learns how much the distances fluctuate."""
        distance, deviation = self.misfit(surface)
        self.fluctuation.update(distance, deviation / self.scale)

    def _residuals(self, seen: Synthesis) -> DepthResiduals:
        """Residuals of the samples of a population of one."""
        found = DepthResiduals(*np.empty((3, seen.pixel.shape[1])))
        normalize(seen.pixel[0], seen.distance[0], self.texels.at(seen.pixel), found)
        return found


@kernel
def write_misfit(
    pixel: NDArray[np.int32],
    residuals: DepthResiduals,
    bits: NDArray[np.uint8],
    free_m: NDArray[np.float32],
    found: NDArray[np.float64],
) -> None:
    """Writes what `ObservedDepth.misfit` returns into zeros (2, n).

    Args:
        pixel: of the samples (n,), see `Synthesis`.
        residuals: of the same.
        bits, free_m: the classes of all pixels, flattened, see `PixelClasses`.
        found: result.
    """
    for v in range(pixel.size):
        at = pixel[v]
        if at <= 0 or bits[at] & UNKNOWN:
            continue
        if residuals.cost[v] < np.inf:
            found[1, v] = 1 / max(residuals.inverse_deviation[v], 1e-9)
            distance = residuals.normalized[v] * found[1, v]
            found[0, v] = min(max(distance, -MAX_MISFIT_M), MAX_MISFIT_M)
        else:
            found[0, v] = free_m[at]

"""Term of a depth sensor: measured compared with synthesised distances."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Image
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesis, Synthesizer
from abs_service.tracker.synthesis.window import WHOLE, Placed, corner
from abs_service.tracker.terms.base import Bounds, facing
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.classification.visibility import Visibility, where
from abs_service.tracker.terms.depth.depth_cost import (
    FREE_SCALE_M,
    depth_cost,
    missing_cost,
    normalize,
)
from abs_service.tracker.terms.depth.fluctuation import Fluctuation
from abs_service.tracker.terms.depth.outline.base import NoOutline, Outline
from abs_service.tracker.terms.depth.outline.continuation import Continuation, NoContinuation
from abs_service.tracker.terms.depth.texels import Unusable, texels
from abs_service.tracker.terms.gradients import color_rows, depth_rows
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.patches import Patches
from abs_service.tracker.terms.sensor_fit import SensorFit, summarize
from abs_service.tracker.terms.vertex_counts import VertexMasks
from calib import pose
from calib.camera import Camera
from calib.noise.base import DepthNoise

#: Nearer to the object than this, a sample in free space is pulled back no more stiffly [m].
MIN_FREE_M = 0.005


#: A measurement that is farther from its vertex is no measurement of the object [m].
LARGEST_MISFIT_M = 0.05


class DepthTerm:
    """−log φ of eqs. 18 and 19, summed over the samples."""

    def __init__(
        self,
        sensor: str,
        synthesizer: Synthesizer,
        vertices: int,
        noise: DepthNoise,
        bounds: Bounds,
        outline: Callable[[Camera], Outline] = lambda camera: NoOutline(),
        continuation: Callable[[Camera], Continuation] = lambda camera: NoContinuation(),
    ):
        self.sensor = sensor
        self._bounds = bounds
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, np.zeros((vertices, 0), np.float32))
        self._outline = outline(self._view.camera)
        self._continuation = continuation(self._view.camera)
        self._classifier = Classifier(self._view.camera)
        self._missing = np.zeros((1, vertices), np.float32)
        self._fluctuation = Fluctuation()
        self._texels = texels(sensor, synthesizer, noise, bounds)
        self._lost, self._covered, self._outside, self._doubtful = (Placed(np.bool_) for _ in range(4))
        self._free_m = Placed(np.float32)
        self._window, self._is_surprised, self._begun = WHOLE, False, False
        self._distance, self._foreground = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.bool_)

    def observe(self, image: Image, predicted: Surface, reach_m: float = np.inf) -> None:
        """Renders the noise model over a depth image; occluded pixels are masked in this frame."""
        if not isinstance(image, DepthImage):
            raise TypeError(f"sensor {self.sensor} has a depth noise model but delivered {type(image).__name__}")
        # What the background is, and where the field of view ends, is learnt from a whole image.
        window = self._synthesizer.window(self.sensor, predicted, reach_m if self._begun else np.inf)
        self._begun = True
        distance = self._texels.observe(image, window, self._fluctuation.scale)
        expected = np.ascontiguousarray(self._view.render(predicted)[window])
        self._view.look(predicted)
        seen = self._classifier.classify(distance, expected, window, self._texels.shape)
        self._is_surprised = not seen.object.any()
        doubtful = self._outline.observe(distance, seen, expected, predicted, window)
        self._continuation.observe(seen.object, window)
        self._window, self._distance, self._foreground = window, distance, seen.foreground
        free_m = where(~doubtful, seen.free_m)
        self._place(seen, doubtful, free_m)
        self._explain_pixels(seen, doubtful, free_m, predicted)

    def _place(self, seen: Visibility, doubtful: NDArray[np.bool_], free_m: NDArray[np.float32]) -> None:
        """Puts what the window shows where samples find it: into images (height + 2, width + 2)."""
        window, shape = self._window, self._texels.shape
        self._lost.put(window, seen.hole | seen.dropout, *shape)
        self._covered.put(window, seen.foreground, *shape)
        self._outside.put(window, seen.beyond, *shape)
        self._doubtful.put(window, doubtful, *shape)
        self._free_m.put(window, free_m, *shape)

    def foreground(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] of occluders."""
        if not self._foreground.any():
            return np.zeros((0, 3))
        rows, columns = np.nonzero(self._foreground)
        camera, (top, left) = self._view.camera, corner(self._window)
        sight = camera.directions(np.stack([left + columns, top + rows], axis=-1))
        return pose.transform(camera.T_rs, sight * self._distance[rows, columns, None])

    def hide(self, points: NDArray[np.float64]) -> None:
        """Does nothing: a depth sensor detects occluders in its own image."""

    def _explain_pixels(
        self, seen: Visibility, doubtful: NDArray[np.bool_], free_m: NDArray[np.float32], predicted: Surface
    ) -> None:
        """Sets constant costs at pixels without a usable distance.

        Behind an occluder, in a hole, and next to an outline with a term of its own, a vertex costs the mean of an
        inlier, so that the cost has no gradient there. In free space it costs an outlier plus a penalty proportional to
        the distance from the object. At other missing returns it costs the more, the less likely they are.
        """
        if self._is_surprised:
            return
        agreeing = self._texels.explain(Unusable(seen.foreground | seen.hole | doubtful, free_m, seen.object))
        most = self._bounds.outlier - self._bounds.inlier - agreeing
        self._missing = missing_cost(self._bounds.no_return, predicted, self._view.camera.center, most)

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log φ (population,) plus the cost of the outline."""
        return self._measured_cost(surface, self._view.synthesize(surface)) + self._outline.cost(surface)

    def _measured_cost(self, surface: Surface, seen: Synthesis) -> NDArray[np.float64]:
        """Cost (population,) of the distances; the density is the larger of inlier and outlier density."""
        out = np.empty(len(seen.pixel))
        missing = self._view.carry(surface, self._missing)
        texture = self._texels.at(seen.pixel)
        depth_cost(seen.pixel, seen.distance, missing, texture, self._bounds.inlier, self._bounds.outlier, out)
        return self._view.balance(out, surface, self._bounds.unseen)

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of inliers and of samples in free space, and their derivatives with respect to Θ."""
        samples, seen = self._view.follow(surface, sparse_jacobian), self._view.synthesize(surface)
        measured, free = (each(surface, samples, seen) for each in (self._linearize_measured, self._linearize_free))
        return [measured, free, self._outline.linearize(surface, sparse_jacobian)]

    def _linearize_measured(self, surface: Surface, samples: SparseJacobian, seen: Synthesis) -> PointLinearization:
        residual, inverse_deviation, cost = self._residuals(seen)
        use = np.flatnonzero(cost < self._bounds.outlier - self._bounds.inlier)
        vertices, normals = (
            self._view.spread(surface, values) for values in (surface.vertices[0].T, surface.normals[0].T)
        )
        rows = depth_rows(vertices, normals, self._view.camera.center, use, inverse_deviation)
        return PointLinearization(residual[use], rows, use, samples, vertices)

    def _linearize_free(self, surface: Surface, samples: SparseJacobian, seen: Synthesis) -> PointLinearization:
        """Residuals of samples in free space, which stop a thin sheet from sliding along itself.

        The cost d / s of a sample that is d from the object is replaced by a square of the same slope, ½ d² / (s d₀).
        """
        pixel = seen.pixel[0]
        away = self._free_m.at(pixel).astype(np.float64)
        out = (pixel > 0) & (away > 0)
        if not out.any():
            return PointLinearization.empty(samples)
        vertices = self._view.spread(surface, surface.vertices[0].T)
        distances = np.ascontiguousarray(self._free_m.inside[..., None])
        weight = 1 / np.sqrt(FREE_SCALE_M * np.maximum(away[out], MIN_FREE_M))
        rows = color_rows(distances, self._view.camera, vertices[out])[:, 0] * weight[:, None]
        return PointLinearization(away[out] * weight, rows, np.flatnonzero(out), samples, vertices)

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self._view.synthesize(surface)
        residual, _, cost = self._residuals(seen)
        measured, pixel = cost < np.inf, np.where(self._outside.at(seen.pixel[0]), 0, seen.pixel[0])
        free = (self._free_m.at(pixel) > 0) & (pixel > 0)
        missing, hidden, unjudged = (image.at(pixel) for image in (self._lost, self._covered, self._doubtful))
        masks = VertexMasks.of(pixel, facing(self._view, surface), missing, hidden, unjudged)
        mean = -float(self._measured_cost(surface, seen)[0]) / residual.size
        size = np.where(free, np.inf, np.abs(residual))
        found = summarize(self.sensor, masks, measured | free, size, mean)
        return replace(
            found,
            normalized_residual=found.normalized_residual * self._fluctuation.scale,  # by the model as it is stated
            rim=self._outline.fit(surface),
            remainder=self._continuation.remainder(surface),
            is_surprised=self._is_surprised,
        )

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """No residuals: there is no appearance."""
        return PointLinearization.empty(sparse_jacobian)

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurement, and the deviation of that by noise (2, n) [m].

        In free space it is that from the object, without noise. Zero where nothing is measured, and everywhere if the
        samples of the synthesis are not the vertices.
        """
        seen = self._view.synthesize(surface)
        if seen.pixel.shape[1] != surface.vertices.shape[2]:
            return np.zeros((2, 1))
        residual, inverse, cost = self._residuals(seen)
        pixel = np.maximum(seen.pixel[0], 0)
        deviation = 1 / np.maximum(inverse, 1e-9)
        signed = np.clip(residual * deviation, -LARGEST_MISFIT_M, LARGEST_MISFIT_M)
        free = self._free_m.at(pixel).astype(np.float64)
        unknown = self._lost.at(pixel) | self._covered.at(pixel) | self._doubtful.at(pixel)
        usable = (seen.pixel[0] > 0) & ~unknown
        measured = cost < np.inf
        return np.stack([np.where(measured, signed, free), np.where(measured, deviation, 0.0)]) * usable

    def learn(self, surface: Surface) -> None:
        """Learns how much the distances fluctuate."""
        distance, deviation = self.misfit(surface)
        self._fluctuation.update(distance, deviation / self._fluctuation.scale)

    def _residuals(self, seen: Synthesis) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Normalised residual, inverse deviation, and unbounded cost, infinite without a measurement, each (n,)."""
        residual, inverse, cost = np.empty((3, seen.pixel.shape[1]))
        normalize(seen.pixel[0], seen.distance[0], self._texels.at(seen.pixel), residual, inverse, cost)
        return residual, inverse, cost

"""Term of a depth sensor: measured compared with synthesised distances."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Image, Window
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.synthesis.window import corner
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, Prediction
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.continuation import Continuation
from abs_service.tracker.terms.depth.depth_cost import missing_cost
from abs_service.tracker.terms.depth.fluctuation import Fluctuation
from abs_service.tracker.terms.depth.observed_depth import ObservedDepth
from abs_service.tracker.terms.depth.outline.base import NoOutline, Outline
from abs_service.tracker.terms.depth.pixel_classes import ClassImages, WindowClasses
from abs_service.tracker.terms.depth.texels import Unusable, texels
from calib import pose
from calib.camera import Camera
from calib.noise.base import DepthNoise


class DepthTerm:
    """−log φ of eqs. 18 and 19, summed over the samples, in one frame after the other.

    Here is what is learnt of a sensor over time, and the memory of the newest frame, which is an `ObservedDepth`.
    """

    finds_occluders = True

    def __init__(
        self,
        sensor: str,
        synthesizer: Synthesizer,
        mesh: Mesh,
        noise: DepthNoise,
        bounds: Bounds,
        outline: Callable[[Camera], Outline] = lambda camera: NoOutline(),
    ):
        self.sensor = sensor
        self._bounds = bounds
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, np.zeros((len(mesh.vertices), 0), np.float32))
        self._outline = outline(self._view.camera)
        self._continuation = Continuation(self._view.camera, mesh)
        self._classifier = Classifier(self._view.camera)
        self._fluctuation = Fluctuation()
        self._texels = texels(sensor, synthesizer, noise, bounds)
        self._classes = ClassImages()
        self._begun = False

    def observe(self, image: Image, prediction: Prediction) -> ObservedDepth:
        """Renders the noise model over a depth image; pixels that show an occluder are masked, and no others."""
        if not isinstance(image, DepthImage):
            raise TypeError(f"sensor {self.sensor} has a depth noise model but delivered {type(image).__name__}")
        # What the background is, and where the field of view ends, is learnt from a whole image.
        predicted, reach_m = prediction.surface, prediction.reach_m if self._begun else np.inf
        window = self._synthesizer.window(self.sensor, predicted, reach_m)
        self._begun = True
        scale = self._fluctuation.scale
        distance = self._texels.observe(image, window, scale, prediction.resampling)
        view, rendered = self._view.observe_rendered(predicted)
        expected = np.ascontiguousarray(rendered[window])
        seen = self._classifier.classify(distance, expected, window, self._texels.shape)
        outline = self._outline.observe(distance, seen, expected, predicted, window)
        classes = WindowClasses.of(seen, outline.doubtful)
        return ObservedDepth(
            sensor=self.sensor,
            view=view,
            bounds=self._bounds,
            texels=self._texels,
            missing=self._explain(Unusable(classes.masked, classes.free_m, seen.object), predicted),
            classes=self._classes.put(classes, window, self._texels.shape),
            occluders=_points(self._view.camera, distance, seen.foreground, window),
            outline=outline,
            remainder=self._continuation.observe(seen.object, window),
            fluctuation=self._fluctuation,
            scale=scale,
            is_surprised=not seen.object.any(),
        )

    def _explain(self, unusable: Unusable, predicted: Surface) -> NDArray[np.float32]:
        """Sets constant costs at pixels without a usable distance; cost (1, n) of a missing return at each vertex.

        Behind an occluder, in a hole, and next to an outline with a term of its own, a vertex costs the mean of an
        inlier, so that the cost has no gradient there. In free space it costs an outlier plus a penalty proportional to
        the distance from the object. At other missing returns it costs the more, the less likely they are. If nothing
        shows the object, it is the prediction that is wrong, and nothing is explained.
        """
        if not unusable.shown.any():
            return np.zeros((1, predicted.vertices.shape[2]), np.float32)
        agreeing = self._texels.explain(unusable)
        maximum = self._bounds.outlier - self._bounds.inlier - agreeing
        return missing_cost(self._bounds.no_return, predicted, self._view.camera.center, maximum)


def _points(
    camera: Camera, distance: NDArray[np.float32], mask: NDArray[np.bool_], window: Window
) -> NDArray[np.float64]:
    """Points (k, 3) [m] of the pixels of a mask (rows, columns) in a window, at measured distances [m]."""
    if not mask.any():
        return NO_OCCLUDERS
    rows, columns = np.nonzero(mask)
    top, left = corner(window)
    sight = camera.directions(np.stack([left + columns, top + rows], axis=-1))
    return pose.transform(camera.T_rs, sight * distance[rows, columns, None])

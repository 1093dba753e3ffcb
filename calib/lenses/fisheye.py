"""Fisheye lens: Kannala and Brandt's polynomial in the angle from the optical axis, as in `cv2.fisheye`."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calib.lenses.lens import MAX_COORDINATE, padded, require_inverse

COEFFICIENTS = ("k1", "k2", "k3", "k4")

#: Below this radius, in normalised coordinates, the scale is 1 to machine precision.
_ON_AXIS = 1e-8


@dataclass(frozen=True, eq=False)
class KannalaBrandt:
    """r_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) at the angle θ from the axis; OpenCV's fisheye model.

    All coefficients zero is the equidistant projection. Missing trailing coefficients are zero. Ideal coordinates are
    x/z and y/z as for every lens, so points 90° from the axis or more are not seen.

    J. Kannala, S. Brandt: A generic camera model and calibration method for conventional, wide-angle, and fish-eye
    lenses. IEEE PAMI 28(8), 2006, eq. 3, divided by its first coefficient, which is part of the focal length.

    Attributes:
        coefficients: (k1, k2, k3, k4), dimensionless, shape (4,).
    """

    name: ClassVar[str] = "fisheye"
    coefficients: NDArray[np.float64] = field(default_factory=lambda: np.zeros(4))

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", padded(self.coefficients, COEFFICIENTS))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, KannalaBrandt) and np.array_equal(self.coefficients, other.coefficients)

    def __hash__(self) -> int:
        return hash(tuple(self.coefficients))

    @property
    def is_pinhole(self) -> bool:
        """Always false: with zero coefficients the projection is equidistant."""
        return False

    def distort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Forward distortion of ideal normalised coordinates, shape (…, 2)."""
        ideal = np.asarray(xy, np.float64)
        radius = np.linalg.norm(ideal, axis=-1, keepdims=True)
        return ideal * self._scale(radius)

    def jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, 2) of `distort` with respect to the ideal normalised coordinates (…, 2)."""
        ideal = np.asarray(xy, np.float64)
        radius = np.linalg.norm(ideal, axis=-1, keepdims=True)
        scale = self._scale(radius)
        along = self._slope(np.arctan(radius)) / (1 + radius**2)  # of the distorted radius by the ideal one
        with np.errstate(divide="ignore", invalid="ignore"):
            outward = np.where(radius < _ON_AXIS, 0, (along - scale) / radius**2)
        return scale[..., None] * np.eye(2) + outward[..., None] * ideal[..., :, None] * ideal[..., None, :]

    def coefficient_jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, 4) of `distort` at ideal normalised coordinates (…, 2) with respect to the coefficients."""
        ideal = np.asarray(xy, np.float64)
        radius = np.linalg.norm(ideal, axis=-1, keepdims=True)
        theta = np.arctan(radius)
        direction = ideal / np.maximum(radius, _ON_AXIS)
        return direction[..., None] * (theta ** [3, 5, 7, 9])[..., None, :]

    def inverse(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Ideal coordinates (…, 2) whose distortion is `xy`; NaN where there are none: at 90° or beyond the fold."""
        distorted = np.asarray(xy, np.float64)
        radius = np.linalg.norm(distorted, axis=-1, keepdims=True)
        theta = self._angle(radius)
        ratio = np.where(radius < _ON_AXIS, 1, np.tan(theta) / np.maximum(radius, _ON_AXIS))
        return distorted * ratio

    def undistort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Ideal coordinates (…, 2) whose distortion is `xy`.

        Raises:
            LensError: where there are none.
        """
        return require_inverse(self, xy, self.inverse(xy))

    def _bent(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distorted radius at an angle [rad]."""
        k1, k2, k3, k4 = self.coefficients
        t2 = theta * theta
        return theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))

    def _slope(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivative of the distorted radius with respect to the angle."""
        k1, k2, k3, k4 = self.coefficients
        t2 = theta * theta
        return 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))

    def _scale(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ratio of distorted to ideal radius."""
        return np.where(radius < _ON_AXIS, 1, self._bent(np.arctan(radius)) / np.maximum(radius, _ON_AXIS))

    def _widest(self) -> float:
        """Largest angle [rad], less than 90°, up to which the distorted radius increases."""
        slope = np.array([9, 7, 5, 3]) * self.coefficients[::-1]
        slope[np.abs(slope) < 1e-12] = 0  # up to 90° it adds nothing, and as a leading coefficient it spoils the roots
        roots = np.roots([*slope, 1.0])  # in θ²
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(min(np.arctan(MAX_COORDINATE), np.sqrt(real.min(initial=np.inf))))

    def _angle(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle [rad] at a distorted radius by bracketed Newton iterations; NaN where there is none."""
        widest = self._widest()
        low, high = np.zeros_like(radius), np.full_like(radius, widest)
        theta = np.minimum(radius, 0.5 * widest)
        with np.errstate(divide="ignore", invalid="ignore"):
            for _ in range(80):
                excess = self._bent(theta) - radius
                low, high = np.where(excess < 0, theta, low), np.where(excess > 0, theta, high)
                step = theta - excess / self._slope(theta)
                following = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
                if not np.any(np.abs(following - theta) > 1e-15):
                    break
                theta = following
        return np.where(radius < self._bent(np.array(widest)), theta, np.nan)

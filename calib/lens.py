"""Lens distortion `D_s` of eq. 10, on normalised image coordinates (x/z, y/z), and its inverse."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

#: Normalised coordinates that no pixel has; an iteration that goes there finds nothing any more.
FARTHEST = 1e6


class LensError(ValueError):
    """Coefficients that are no lens, or a point for which the distortion has no inverse."""


@dataclass(frozen=True)
class Lens:
    """Brown–Conrady distortion with an optional rational part; OpenCV's first eight coefficients, in its order.

    All coefficients zero is the ideal pinhole. Missing trailing coefficients are zero, so the usual 4, 5 and 8 numbers
    can be given as they are.

    Attributes:
        coefficients: (k1, k2, p1, p2, k3, k4, k5, k6), dimensionless, shape (8,).
    """

    coefficients: NDArray[np.float64] = field(default_factory=lambda: np.zeros(8))

    def __post_init__(self) -> None:
        given = np.atleast_1d(np.asarray(self.coefficients, np.float64))
        if given.ndim != 1 or given.size > 8 or not np.all(np.isfinite(given)):
            raise LensError(f"a lens has at most 8 finite coefficients {COEFFICIENTS}, not {given.tolist()}")
        full = np.zeros(8)
        full[: given.size] = given
        full.setflags(write=False)
        object.__setattr__(self, "coefficients", full)

    @property
    def is_pinhole(self) -> bool:
        """Whether the lens does not distort at all."""
        return not np.any(self.coefficients)

    def distort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Forward distortion of ideal normalised coordinates, shape (…, 2)."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.coefficients
        x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )

    def jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Derivatives (…, 2, 2) of `distort` by the ideal normalised coordinates (…, 2)."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.coefficients
        x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
        r2 = x * x + y * y
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
        # Twice the derivative of the radial factor by r², since r² changes by 2x and 2y.
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below
        result = np.empty((*r2.shape, 2, 2))
        result[..., 0, 0] = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        result[..., 0, 1] = result[..., 1, 0] = x * y * slope + 2 * p1 * x + 2 * p2 * y
        result[..., 1, 1] = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        return result

    def undistort(self, xy: NDArray[np.floating], tolerance: float = 1e-10) -> NDArray[np.float64]:
        """Backward distortion: the ideal coordinates whose distortion is `xy`, shape (…, 2), by Newton's method.

        Raises:
            LensError: where the iteration does not reach `tolerance` (normalised units), with the first such point.
        """
        target = np.ascontiguousarray(xy, np.float64).reshape(-1, 2)
        ideal = target.copy()
        if self.is_pinhole:
            return ideal.reshape(np.shape(xy))
        for _ in range(30):
            residual = self.distort(ideal) - target
            if np.all(np.abs(residual) < tolerance) and np.all(self._is_before_fold(ideal)):
                return ideal.reshape(np.shape(xy))
            try:
                inverse = np.linalg.inv(self.jacobian(ideal))
            except np.linalg.LinAlgError:  # exactly on a fold
                break
            step = np.einsum("nij,nj->ni", inverse, residual)
            if not np.all(np.abs(step) < FARTHEST):
                break
            ideal -= step
        error = np.where(self._is_before_fold(ideal), np.abs(self.distort(ideal) - target).max(axis=1), np.inf)
        worst = target[error.argmax()]
        raise LensError(f"the distortion {self.coefficients.tolist()} has no inverse at normalised {worst.tolist()}")

    def _is_before_fold(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the distortion is one-to-one from the centre to each point (n, 2).

        A barrel's polynomial turns back at some radius. Beyond it every pixel has a second solution, from where no
        light reaches the sensor.
        """
        before = np.ones(len(xy), np.bool_)
        for part in (0.25, 0.5, 0.75, 1.0):
            jacobian = self.jacobian(part * xy)
            before &= (np.linalg.det(jacobian) > 0) & (np.trace(jacobian, axis1=1, axis2=2) > 0)
        return before

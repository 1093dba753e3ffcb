"""Lens distortion `D_s` of eq. 10 in normalised image coordinates (x/z, y/z), and its inverse."""

from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

#: Bound on normalised coordinates; an iteration beyond it has diverged.
MAX_COORDINATE = 1e6

#: Convergence tolerance of the inverse, in normalised coordinates.
TOLERANCE = 1e-10


class LensError(ValueError):
    """Invalid coefficients, or a point at which the distortion has no inverse."""


@runtime_checkable
class LensModel(Protocol):
    """Lens model as used by cameras, calibration and warping.

    Attributes:
        name: name of the model in rig files and recordings.
        coefficients: dimensionless, read-only; their number depends on the model.
    """

    name: ClassVar[str]

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The coefficients (n,)."""
        ...

    @property
    def is_pinhole(self) -> bool:
        """True if the lens does not distort."""
        ...

    def distort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Forward distortion of ideal normalised coordinates, shape (…, 2)."""
        ...

    def jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, 2) of `distort` with respect to the ideal normalised coordinates (…, 2)."""
        ...

    def coefficient_jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, n) of `distort` at ideal normalised coordinates (…, 2) with respect to the n coefficients."""
        ...

    def inverse(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Backward distortion: ideal coordinates (…, 2) whose distortion is `xy`; NaN where there are none."""
        ...

    def undistort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points without distortion, see `inverse`, which does not raise where there is no solution.

        Raises:
            LensError: at least one point has no inverse; names one.
        """
        ...


def padded(given: ArrayLike, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Coefficients padded with zeros, read-only.

    Raises:
        LensError: too many, or not finite numbers.
    """
    try:
        numbers = np.atleast_1d(np.asarray(given, np.float64))
    except (TypeError, ValueError):
        raise LensError(f"a lens has at most {len(names)} finite coefficients {names}, not {given!r}") from None
    if numbers.ndim != 1 or numbers.size > len(names) or not np.all(np.isfinite(numbers)):
        raise LensError(f"a lens has at most {len(names)} finite coefficients {names}, not {numbers.tolist()}")
    full = np.zeros(len(names))
    full[: numbers.size] = numbers
    full.setflags(write=False)
    return full


def require_inverse(lens: LensModel, xy: NDArray[np.floating], ideal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ideal coordinates (…, 2) computed for distorted ones `xy` (…, 2), checked for NaN.

    Raises:
        LensError: NaN at some point; names the first one.
    """
    missing = np.isnan(ideal).any(axis=-1)
    if missing.any():
        first = np.asarray(xy, np.float64)[missing][0]
        raise LensError(f"the distortion {lens.coefficients.tolist()} has no inverse at normalised {first.tolist()}")
    return ideal


@dataclass(frozen=True, eq=False)
class Lens:
    """Brown–Conrady distortion with an optional rational part; OpenCV's first eight coefficients, in its order.

    All coefficients zero is the ideal pinhole. Missing trailing coefficients are zero, so the common sets of 4, 5 and 8
    numbers are accepted.

    Attributes:
        coefficients: (k1, k2, p1, p2, k3, k4, k5, k6), dimensionless, shape (8,).
    """

    name: ClassVar[str] = "brown_conrady"
    coefficients: NDArray[np.float64] = field(default_factory=lambda: np.zeros(8))

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", padded(self.coefficients, COEFFICIENTS))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Lens) and np.array_equal(self.coefficients, other.coefficients)

    def __hash__(self) -> int:
        return hash(tuple(self.coefficients))

    @property
    def is_pinhole(self) -> bool:
        """True if the lens does not distort."""
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
        """Jacobian (…, 2, 2) of `distort` with respect to the ideal normalised coordinates (…, 2)."""
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

    def coefficient_jacobian(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Jacobian (…, 2, 8) of `distort` at ideal normalised coordinates (…, 2) with respect to the coefficients."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
        r2 = x * x + y * y
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
        above = np.stack([r2, r2**2, r2**3], axis=-1) / below[..., None]
        by_radial = np.concatenate([above, -radial[..., None] * above], axis=-1)[..., None, :]
        result = np.empty((*r2.shape, 2, 8))
        result[..., [0, 1, 4, 5, 6, 7]] = np.asarray(xy, np.float64)[..., None] * by_radial
        result[..., 0, 2] = result[..., 1, 3] = 2 * x * y
        result[..., 0, 3] = r2 + 2 * x * x
        result[..., 1, 2] = r2 + 2 * y * y
        return result

    def inverse(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Ideal coordinates (…, 2) whose distortion is `xy`, by Newton's method; NaN where it does not converge."""
        target = np.ascontiguousarray(xy, np.float64).reshape(-1, 2)
        ideal = target.copy()
        if self.is_pinhole:
            return ideal.reshape(np.shape(xy))
        moving = np.arange(len(ideal))
        with np.errstate(all="ignore"):
            for _ in range(30):
                residual = self.distort(ideal[moving]) - target[moving]
                left = ~np.all(np.abs(residual) < TOLERANCE, axis=1)
                moving, residual = moving[left], residual[left]
                if len(moving) == 0:
                    break
                ideal[moving] -= _solved(self.jacobian(ideal[moving]), residual)
                ideal[~np.all(np.abs(ideal) < MAX_COORDINATE, axis=1)] = np.nan
            ideal[moving] = np.nan
            ideal[~self._is_before_fold(ideal)] = np.nan
        return ideal.reshape(np.shape(xy))

    def undistort(self, xy: NDArray[np.floating]) -> NDArray[np.float64]:
        """Ideal coordinates (…, 2) whose distortion is `xy`.

        Raises:
            LensError: where there are none.
        """
        return require_inverse(self, xy, self.inverse(xy))

    def _is_before_fold(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """True for points (n, 2) up to which the distortion is one-to-one along the ray from the centre.

        Barrel distortion folds back at some radius. Beyond it a pixel has a second solution, from which no light
        reaches the sensor.
        """
        before = np.ones(len(xy), np.bool_)
        for part in (0.25, 0.5, 0.75, 1.0):
            a, b, c, d = np.moveaxis(self.jacobian(part * xy).reshape(-1, 4), -1, 0)
            before &= (a * d > b * c) & (a + d > 0)
        return before


def _solved(matrices: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solutions (n, 2) of linear systems (n, 2, 2) by Cramer's rule; a singular system gives non-finite values."""
    a, b, c, d = np.moveaxis(matrices.reshape(-1, 4), -1, 0)
    x, y = right.T
    return np.stack([d * x - b * y, a * y - c * x], axis=-1) / (a * d - b * c)[:, None]

"""How often the truth lies inside the region that should hold it 95 times of 100.

  python -m evaluation.method.posterior [--seeds 1 2 3] [--frames 150] [--device sheet] [--sigma 4]

Images and truth are from the simulator's ray-casting, which knows nothing of control points. Tested in every frame but
the first, which defines the material points:

- each vertex's material point against the vertex's own covariance, in three dimensions (χ² of 3 degrees of freedom);
- Θ against its covariance, once in all its directions and once in those alone of which the sensors say more than the
  priors do (χ² of as many degrees as there are directions). The true Θ is the one whose mesh is nearest to all
  material points; what no Θ can remedy of a vertex's place is no error of Θ.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.stats import chi2

from abs_service.tracker.estimate import Estimate
from abs_service.tracker.models import nurbs
from abs_service.tracker.models.base import DeformationModel, SparseJacobian
from abs_service.tracker.posterior.covariance import propagated
from abs_service.tracker.posterior.stretch_prior import StretchPrior
from abs_service.tracker.terms.linearization import stack
from evaluation.sequences import expose, track
from tests.tracker.driving import default_plan, rig_of, simulate, with_color_deviation

SHARE = 0.95
#: Deviation of a colour in the default rig [levels of 256].
DEMO_SIGMA = 4.0


@dataclass(frozen=True)
class Coverage:
    """What became of one sequence.

    Attributes:
        vertices: share of (vertex, frame) pairs whose true point lies inside the vertex's 95 % region.
        bare: the same without what was unknown of the mesh when it was made.
        sensed: share of the frames in which the true Θ lies inside its 95 % region, in the directions of which the
            sensors say more than the priors.
        directions: number of these, mean over the frames.
        theta: share of the frames in which the true Θ lies inside its 95 % region in all directions.
        said_mm, true_mm: root mean square of a vertex's error by its covariance, and in truth [mm].
    """

    vertices: float
    bare: float
    sensed: float
    directions: float
    theta: float
    said_mm: float
    true_mm: float


def coverage(uri: str, frames: int, sigma: float = DEMO_SIGMA) -> Coverage:
    """Tracks a simulated device with the default tracker and `sigma` as deviation of its colours [levels]."""
    simulation = simulate(uri)
    rig = with_color_deviation(rig_of(simulation), sigma)
    found = track(rig, default_plan(model=nurbs.Settings()), expose(simulation, range(frames)))
    rows, said, true = [], [], []
    for model, estimate, points in list(zip(found.models, found.estimates, found.material))[1:]:
        error, known = points - estimate.vertices, estimate.covariance
        jacobian = model.jacobian(estimate.theta)
        off = np.asarray(np.linalg.lstsq(jacobian.reshape(error.size, -1), error.ravel())[0], np.float64)
        sensed = _sensed(known, _prior(model, estimate, jacobian, 1 / simulation.rate_hz))
        within = [
            _inside(error, estimate.vertex_covariance),
            _inside(error, propagated(SparseJacobian.from_dense(jacobian), known)),
            _inside((sensed @ off)[None], (sensed @ known @ sensed.T)[None]),
            len(sensed),
            _inside(off[None], known[None]),
        ]
        rows.append([np.mean(part) for part in within])
        said.append(np.trace(estimate.vertex_covariance, axis1=1, axis2=2))
        true.append(np.sum(error**2, axis=1))
    lengths_mm = (float(np.sqrt(np.mean(squares)) * 1e3) for squares in (said, true))
    return Coverage(*np.mean(rows, axis=0).tolist(), *lengths_mm)


def _prior(
    model: DeformationModel, estimate: Estimate, jacobian: NDArray[np.float64], interval_s: float
) -> NDArray[np.float64]:
    """Curvature (dim, dim) of the priors alone at an estimate, for the derivatives (n, 3, dim) of its vertices."""
    settings = default_plan().priors
    surface = model.deform(estimate.theta[None])
    parts = StretchPrior(model.mesh, settings.stretch).linearize(surface, SparseJacobian.from_dense(jacobian))
    stretch = stack(parts, jacobian.shape[2]).jacobian
    motion = np.diag(1 / (model.scales * settings.speed * interval_s))
    rows = np.concatenate([stretch, model.prior, motion])
    return rows.T @ rows


def _sensed(covariance: NDArray[np.float64], prior: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (k, dim) of Θ whose variance the sensors at least halve, for the priors' curvature (dim, dim)."""
    gain, directions = eigh(np.linalg.inv(covariance), prior)  # gain: 1 where only the priors say anything
    return np.linalg.inv(directions)[gain > 2]


def _inside(error: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether errors (n, d) lie inside the ellipsoids of covariances (n, d, d) that should hold 95 % of them."""
    square = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    return square < chi2.ppf(SHARE, error.shape[1])


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--device", default="sheet", help="scene, or scene?key=value&…, of the simulated device")
    parser.add_argument("--sigma", type=float, default=DEMO_SIGMA, help="deviation of a colour [levels of 256]")
    arguments = parser.parse_args()
    print("| seed | vertices | without the mesh's own | Θ as sensed | directions | Θ | said mm | in truth mm |")
    print("|---|---|---|---|---|---|---|---|")
    for seed in arguments.seeds:
        joint = "&" if "?" in arguments.device else "?"
        found = coverage(f"simulated://{arguments.device}{joint}seed={seed}", arguments.frames, arguments.sigma)
        print(
            f"| {seed} | {found.vertices:.1%} | {found.bare:.1%} | {found.sensed:.1%} | {found.directions:.1f} | "
            f"{found.theta:.1%} | {found.said_mm:.2f} | {found.true_mm:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()

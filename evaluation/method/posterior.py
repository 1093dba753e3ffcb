"""Coverage of the 95 % regions: share of cases in which the truth lies inside the region given by the covariance.

Images and truth come from the simulator's ray casting, which has no control points. Tested in every frame except the
first, which defines the material points:

- each vertex's material point against the vertex's own covariance, in three dimensions (χ² with 3 degrees of freedom);
- Θ against its covariance, in all directions, and in those directions alone in which the sensors contribute more than
  the priors (χ² with as many degrees of freedom as directions). The true Θ is the one whose mesh is nearest to all
  material points; the remaining distance is no error of Θ.

Statistic: share of vertices and frames inside, of every seed; of Θ, mean of the seeds.
Goals: 90 to 99 %; for vertices in every seed.
Seeds: the context's + 1, 2, 3, 11, 12, 13 and 14.
"""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from abs_service.report.content import Column, Section, Table
from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracker.models.base import DeformationModel, SparseJacobian
from abs_service.tracker.posterior.priors import settings as priors
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.linearization import propagated, stack
from calib.noise.images.color import GaussianColor
from evaluation.experiment import Context, Findings, at_least, at_most
from evaluation.sequences import demo_plan, demo_rig, expose, simulate, track, with_noise
from evaluation.statistics import inside_region

#: Standard deviation of a colour in the default rig [levels of 256].
DEMO_SIGMA = 4.0

TITLE = "Coverage of the covariances of vertices and of Θ"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated sequences, added to the context's seed.
        frames: of each sequence.
        device: scene, or scene?key=value&…, of the simulated device.
        sigma: standard deviation of a colour in the tracker's noise model [levels of 256].
    """

    seeds: tuple[int, ...] = (1, 2, 3, 11, 12, 13, 14)
    frames: int = 150
    device: str = "sheet"
    sigma: float = DEMO_SIGMA


QUICK = Settings((1,), 12)


@dataclass(frozen=True)
class Coverage:
    """Coverage in one sequence.

    Attributes:
        vertices: share of (vertex, frame) pairs whose true point lies inside the vertex's 95 % region.
        theta_only: the same with the covariance of Θ alone, without the error of the initial mesh.
        sensed: share of the frames in which the true Θ lies inside its 95 % region, in the directions in which the
            sensors contribute more than the priors.
        directions: number of these, mean over the frames.
        theta: share of the frames in which the true Θ lies inside its 95 % region in all directions.
        predicted_mm, true_mm: root mean square error of a vertex by its covariance, and in truth [mm].
    """

    vertices: float
    theta_only: float
    sensed: float
    directions: float
    theta: float
    predicted_mm: float
    true_mm: float


_COLUMNS = (
    Column("seed"), Column("vertices", "", ".1%"), Column("without the mesh's own error", "", ".1%"),
    Column("Θ as sensed", "", ".1%"), Column("directions", "", ".1f"), Column("Θ", "", ".1%"),
    Column("predicted error", "mm", ".2f"), Column("true error", "mm", ".2f"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the device with every seed."""
    found, joint = {}, "&" if "?" in settings.device else "?"
    for seed in (context.seed + one for one in settings.seeds):
        context.progress(f"seed {seed}")
        found[seed] = coverage(f"simulated://{settings.device}{joint}seed={seed}", settings.frames, settings.sigma)
    vertices = [one.vertices for one in found.values()]
    sensed = float(np.mean([one.sensed for one in found.values()]))
    goals = (
        at_least("Coverage of the vertices, the lowest of the seeds", min(vertices), 0.90),
        at_most("Coverage of the vertices, the highest of the seeds", max(vertices), 0.99),
        at_least("Coverage of Θ as sensed, mean of the seeds", sensed, 0.90),
        at_most("Coverage of Θ as sensed, mean of the seeds", sensed, 0.99),
    )
    rows = tuple((seed, *asdict(one).values()) for seed, one in found.items())
    table = Table("Share of cases in which the truth lies inside the 95 % region", _COLUMNS, rows)
    return Findings(goals, (Section("Coverage", (table,)),), {str(seed): asdict(one) for seed, one in found.items()})


def coverage(uri: str, frames: int, sigma: float = DEMO_SIGMA) -> Coverage:
    """Tracks a simulated device with the default tracker; `sigma`: standard deviation of the colours [levels]."""
    simulation = simulate(uri)
    rig, plan = with_noise(demo_rig(simulation), "color", GaussianColor(sigma)), demo_plan()
    found = track(rig, plan, expose(simulation, range(frames)))
    rows, predicted, true = [], [], []
    for model, estimate, points in list(zip(found.models, found.estimates, found.material))[1:]:
        error, known = points - estimate.vertices, estimate.covariance
        jacobian = model.sparse_jacobian(estimate.theta).dense
        off = np.asarray(np.linalg.lstsq(jacobian.reshape(error.size, -1), error.ravel())[0], np.float64)
        sensed = _sensed(known, _prior(model, estimate, jacobian, plan.priors, 1 / simulation.rate_hz))
        within = [
            inside_region(error, estimate.vertex_covariance),
            inside_region(error, propagated(SparseJacobian.from_dense(jacobian), known)),
            inside_region((sensed @ off)[None], (sensed @ known @ sensed.T)[None]),
            len(sensed),
            inside_region(off[None], known[None]),
        ]
        rows.append([np.mean(part) for part in within])
        predicted.append(np.trace(estimate.vertex_covariance, axis1=1, axis2=2))
        true.append(np.sum(error**2, axis=1))
    lengths_mm = (float(np.sqrt(np.mean(squares)) * 1e3) for squares in (predicted, true))
    return Coverage(*np.mean(rows, axis=0).tolist(), *lengths_mm)


def _prior(
    model: DeformationModel,
    estimate: Estimate,
    jacobian: NDArray[np.float64],
    settings: priors.Settings,
    interval_s: float,
) -> NDArray[np.float64]:
    """Hessian (dim, dim) of the priors alone at an estimate with the Jacobian (n, 3, dim) of its vertices."""
    surface = model.deform(estimate.theta[None])
    parts = StretchPrior(model.mesh, settings.stretch).linearize(surface, SparseJacobian.from_dense(jacobian))
    stretch = stack(parts, jacobian.shape[2]).jacobian
    motion = ChangeMetric(model.scales, model.roughness).root / (settings.speed * interval_s)
    rows = np.concatenate([stretch, model.prior, motion])
    return rows.T @ rows


def _sensed(covariance: NDArray[np.float64], prior: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (k, dim) of Θ whose variance the sensors at least halve; `prior` is the priors' Hessian (dim, dim)."""
    gain, directions = eigh(np.linalg.inv(covariance), prior)  # gain: 1 where only the priors contribute
    return np.linalg.inv(directions)[gain > 2]

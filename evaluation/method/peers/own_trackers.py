"""Our own trackers on the peers' terms: the same template in its first pose, then depth images alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observation, Source
from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracker.posterior.priors import settings as priors
from abs_service.tracker.synthesis import sparse
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.plan import OptimizerSettings, Plan
from abs_service.tracking.session import TrackingSession
from calib.noise.constant import Constant
from calib.rig import Rig, Sensor
from evaluation.scenes.bent_sheet import CAMERA, SIDE, SIZE, SheetFrame, State, places

#: What the template adds to the defaults: where nine of ten vertices agree with their measurements as a rule, three of
#: ten that do not are a loss; the sheet is looked for in the next frame, and stays the same sheet.
STATUS = status.Settings(degraded_below=0.85, lost_below=0.7)
REINITIALIZATION = loss_monitor.Settings(after_s=0.0, keep_s=3600.0, every_s=0.1)


@dataclass(frozen=True)
class Setup:
    """One of our trackers.

    Attributes:
        model: "nurbs" or "flexpad".
        optimizer: its search.
        surface: settings of a NURBS.
    """

    model: str
    optimizer: OptimizerSettings
    surface: nurbs.Settings = field(default_factory=nurbs.Settings)


#: A search that never samples: what the descent alone is worth.
DESCENT = hybrid.Settings(fallback_above=0.999, fallback_until=0.998)

#: What the rows are called. By default, the sheet gets 5 × 4 control points of degree 3. They can bend to ±120° along
#: the long side without stretching (0.1 mm off); 4 × 4 of degree 2, the paper's, cannot (0.8 mm, and 3 % stretched).
SETUPS: Mapping[str, Setup] = {
    "hybrid, NURBS by default": Setup("nurbs", hybrid.Settings()),
    "hybrid, NURBS 5 × 4, degree 3": Setup("nurbs", hybrid.Settings(), nurbs.Settings((5, 4))),
    "hybrid, NURBS 4 × 4, degree 2": Setup("nurbs", hybrid.Settings(), nurbs.Settings((4, 4), 2)),
    "hybrid, FlexPad": Setup("flexpad", hybrid.Settings()),
    "descent alone, NURBS by default": Setup("nurbs", DESCENT),
    "cma_es, 20 generations": Setup("nurbs", cma_es.Settings()),
    "cma_es, 60 generations": Setup("nurbs", cma_es.Settings(generations=60)),
}


@dataclass(frozen=True)
class Template:
    """Settings of a model whose mesh and first pose are known, as the competitors know them; what is seen is not asked.

    Attributes:
        setup: the model.
        first: the sheet in the first frame, flat if the model is FlexPad.
    """

    setup: Setup
    first: State

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of the sheet."""
        return SIZE

    def build(self, detection: InitialDetection) -> DeformationModel:
        """The model, in the first pose."""
        if self.setup.model == "flexpad":
            middle, right, down = self.first.points(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
            T_ro = np.eye(4)
            T_ro[:3] = np.stack(
                [right - middle, down - middle, np.cross(right - middle, down - middle), middle], axis=1
            )
            turned, settings = Sheet(T_ro, *SIZE), flexpad.Settings()
            return flexpad.FlexPad(turned, SIDE**2, settings.minimum_radius_m, settings.bend_deviation)
        return self.setup.surface.of_mesh(replace(template(self.first), pixel_deviation=detection.deviation))


def template(state: State) -> Mesh:
    """The sheet as a mesh of 20 × 20 vertices; its chart is the places on the flat sheet."""
    grid = places(SIDE, SIDE)
    faces = triangles(np.arange(SIDE**2).reshape(SIDE, SIDE)).astype(np.int32)
    unknown = np.full((SIDE**2, 3), np.nan, np.float32)
    return Mesh(state.points(grid).reshape(-1, 3), faces, unknown, grid.reshape(-1, 2))


class OwnTracker:
    """One of our trackers as a tracker of frames.

    Attributes:
        places: where on the flat sheet its vertices are (n, 2) [m].
        estimate: of the last frame.

    Args:
        setup: what it is made of.
        first: the first frame, of which the pose is known; it is tracked at once.
        sigma: standard deviation of the distances [m].
        seed: of the search.
    """

    def __init__(self, setup: Setup, first: SheetFrame, sigma: float, seed: int):
        plan = Plan(
            reference="tof",
            model=Template(setup, first.state),
            region=nearest.Settings(),
            synthesis=sparse.Settings(),
            objective=likelihood.Settings(),
            optimizer=setup.optimizer,
            evaluations=100_000,
            vertices=SIDE**2,
            priors=priors.Settings(),
            status=STATUS,
            reinitialization=REINITIALIZATION,
            seed=seed,
        )
        self._session = TrackingSession(Rig("peers", {"tof": Sensor("tof", CAMERA, Constant(sigma))}), plan)
        self.estimate: Estimate
        self.track(first)
        mesh = template(first.state) if self._session.mesh is None else self._session.mesh
        self.places = mesh.chart if setup.model == "nurbs" else _inner_places(mesh.chart)

    def track(self, frame: SheetFrame) -> NDArray[np.floating]:
        """Vertices (n, 3) [m] in a frame."""
        image = DepthImage(frame.distance, np.full_like(frame.distance, np.nan))
        seen = Observation(0, frame.t_ns, {"tof": image}, {"tof": Source(0, frame.t_ns)}, ())
        self.estimate = self._session.track_observation(seen, lambda: True)
        return self.estimate.vertices


def _inner_places(chart: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (n, 2) [m] of a mesh whose outermost vertices are half a cell inside the rim."""
    return ((chart + 0.5) / (chart.max(axis=0) + 1) - 0.5) * SIZE

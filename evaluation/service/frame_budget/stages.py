"""Stages of a frame, and the functions at which they begin."""

from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.shape_quality import ShapeComparison
from abs_service.tracker.objectives.base import TermSum
from abs_service.tracker.posterior.covariance.theta_covariance import ThetaCovariance
from abs_service.tracker.posterior.covariance.vertex_covariance import VertexCovariance
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.synthesis.sparse import Sparse, SparseView
from abs_service.tracker.terms.depth import texels
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.tracker import Tracker
from abs_service.tracking.observer import Observer
from abs_service.tracking.session import TrackingSession
from drivers.encoding import codec
from evaluation.service.frame_budget.stopwatch import Seam

READ = "read the file"
COPY = "copy the images"
ENCODE = "encode"

#: In the order in which a frame goes through them. What a stage calls of another one counts for that one.
SEAMS = (
    Seam("decode", codec, "decode"),
    Seam("pair", Synchroniser, "add"),
    Seam("session, status", TrackingSession, "track"),
    Seam("convert", Observer, "observe"),
    Seam("predict", Posterior, "observe"),
    Seam("textures, masks", TermSum, "observe"),
    Seam("window", Sparse, "window"),
    Seam("noise rendering", texels, "corrected_distances"),
    Seam("noise rendering", texels, "write_pixels"),
    Seam("rendered prediction", SparseView, "render"),
    Seam("visible vertices", SparseView, "_observe"),
    Seam("classify", Classifier, "classify"),
    Seam("outline", RimOutline, "observe"),
    Seam("colour", ColorTerm, "observe"),
    Seam("search", Tracker, "_minimize"),
    Seam("posterior", FramePosterior, "optimum"),
    Seam("posterior", ThetaCovariance, "update"),
    Seam("posterior", VertexCovariance, "update"),
    Seam("session, status", FramePosterior, "fits"),
    Seam("session, status", ShapeComparison, "compare"),
    Seam("session, status", status, "judge"),
)

#: All stages of a frame, in their order.
STAGES = (*dict.fromkeys(seam.stage for seam in SEAMS), ENCODE)

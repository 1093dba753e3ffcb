"""Factory of terms: the type of a sensor's noise model selects the term."""

from collections.abc import Callable
from functools import partial

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.barrier import BarrierTerm
from abs_service.tracker.terms.base import Bounds, Term
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.outline import NoOutline, Outline, RimOutline
from abs_service.tracker.terms.depth.rim import Rim
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Active, Passive
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    TextureRegistrationNoise,
)
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.bayer import GaussianBayer
from calib.noise.binary import LightBarrier
from calib.noise.color import GaussianColor
from calib.noise.grey import GaussianGrey
from calib.noise.intensity import GaussianIntensity
from calib.rig import Sensor


def make_term(
    sensor: Sensor,
    mesh: Mesh,
    synthesizer: Synthesizer,
    bounds: Bounds,
    misplacement: TextureRegistrationNoise = NO_REGISTRATION_NOISE,
    outline_px: float = 0.0,
) -> Term:
    """Term of a sensor for a mesh, under the sensor's own noise model.

    Depth sensors compare the outline with the mesh's rim, with standard deviation `outline_px`; 0 disables this.
    """
    name = sensor.name
    match sensor.noise:
        case DepthNoise() as noise:
            return DepthTerm(name, synthesizer, len(mesh.vertices), noise, bounds, _outline(mesh, outline_px))
        case GaussianColor() as noise:
            return ColorTerm(name, synthesizer, mesh.appearance_of(name), noise, bounds, misplacement)
        case GaussianGrey() | GaussianBayer() as noise:
            return ChannelTerm(name, synthesizer, mesh.appearance_of(name), noise, Passive(), bounds, misplacement)
        case GaussianIntensity(illumination="active") as noise:
            return ChannelTerm(
                name, synthesizer, mesh.appearance_of(name), noise, Active(sensor.camera.center), bounds, misplacement
            )
        case GaussianIntensity() as noise:
            return ChannelTerm(name, synthesizer, mesh.appearance_of(name), noise, Passive(), bounds, misplacement)
        case LightBarrier() as noise:
            return BarrierTerm(name, sensor.camera, mesh.faces, noise, bounds)


def _outline(mesh: Mesh, deviation_px: float) -> Callable[[Camera], Outline]:
    return partial(RimOutline, rim=Rim.of(mesh), deviation=deviation_px) if deviation_px else lambda camera: NoOutline()

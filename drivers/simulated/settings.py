"""Settings of a simulation, as an address has them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from drivers.simulated.faults import FaultSchedule

#: Scenes with a print whose edges are sharper than a pixel, and the blur of the lenses there [px]. A camera with pixels
#: that are sensitive all over and this blur has a modulation transfer of 0.2 at the Nyquist frequency, a usual one.
#: Without both, an edge is in the image where a pixel's centre is: up to half a pixel off, all along.
SHARP: Mapping[str, float] = {"board": 0.5}


@dataclass(frozen=True)
class Settings:
    """Scene and sensors of a simulation; the fields are the keys of an address.

    Attributes:
        scene: one of `scenes.SCENES`.
        seed: random seed of motion, texture and noise.
        sensors: heads, of `optics.OPTICS` and `optics.BEAMS`.
        sizes: image sizes [px] of heads that differ from the default; in the address `color=640x480`.
        rate: exposures per second [Hz].
        noise: factor on all random errors; with 0 only quantisation remains.
        offset: mean offset of the time-of-flight head's distances [m].
        wiggle: amplitude of its periodic offset (wiggling error) [m].
        dark: its amplitude-dependent offset, times the amplitude [m].
        pattern: standard deviation of its fixed pattern noise [m].
        bend: maximum bend of the sheet from end to end [degrees].
        speed: factor on the speed of all motion; with 0 the scene is static.
        jitter_ms: standard deviation of the timestamps' error [ms].
        fault: injected fault and its first exposure, such as `fault=stall@20`; see `faults.Fault`.
        occluder: `hand` if a hand crosses the view in front of the tracked surface, else `none`.
        turn: time at which the tracked surfaces rotate by 90° within a quarter of a second, permanently [s].
        leave: time interval in which they are out of view [s]; in the address `leave=3,5`.
        stiffness: bending stiffness of the strip per width [N·m].
        weight: mass of the strip per area [kg/m²].
        distance: of the bare wall, along the rig's z axis [m].
        reflectivity: of the bare wall, equal in all channels.
        tilt: of the bare wall, about the rig's y axis [degrees].
        board: pattern of the calibration board, one of `printed.TARGETS`.
        hold: duration of each of its poses [s].
        reach: lateral range of its poses; 1 is the field of view of the time-of-flight head.
        texture: of a sheet: `smooth`; `fine`, a print with details of 1 to 3 px in a colour head of 640x480; `paper`,
            white with dots in four inks.
        lens: distortion coefficients of all heads; `lens=-0.2,0.05` is k1 and k2 of a barrel distortion.
        lens_model: distortion model of `lens`: `brown_conrady`, or `fisheye` with up to four coefficients.
        order: filter pattern of the Bayer head, one of `bayer.ORDERS`.
        blur: of the lenses of the colour and Bayer heads: σ of a Gaussian [px].
        crosstalk: fraction of a Bayer pixel's light that is measured by its four neighbours.
    """

    scene: str
    seed: int = 1
    sensors: tuple[str, ...] = ("tof", "color")
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    rate: float = 30.0
    noise: float = 1.0
    offset: float = 0.0
    wiggle: float = 0.0
    dark: float = 0.0
    pattern: float = 0.0
    bend: float = 60.0
    speed: float = 1.0
    jitter_ms: float = 0.0
    occluder: str = "none"
    fault: FaultSchedule = field(default_factory=FaultSchedule)
    turn: float = math.inf
    leave: tuple[float, float] = (math.inf, math.inf)
    stiffness: float = 0.01
    weight: float = 0.3
    distance: float = 1.0
    reflectivity: float = 0.5
    tilt: float = 0.0
    board: str = "chessboard"
    hold: float = 1.0
    reach: float = 1.0
    texture: str = "smooth"
    lens: tuple[float, ...] = (0.0,)
    lens_model: str = "brown_conrady"
    order: str = "grbg"
    blur: float = 0.0
    crosstalk: float = 0.0

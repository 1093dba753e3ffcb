"""Addresses `simulated://scene?key=value&…`; unknown keys and values are errors."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from calib.lenses.by_name import lens_of
from calib.lenses.lens import COEFFICIENTS, LensError, LensModel
from drivers.contract import address
from drivers.contract import address_values as values
from drivers.contract.device import AddressError
from drivers.simulated import faults
from drivers.simulated.faults import FaultSchedule
from drivers.simulated.scene.excursion import Excursion
from drivers.simulated.scenes import SCENES, SceneSettings
from drivers.simulated.sensors.bayer import ORDERS, Mosaic
from drivers.simulated.sensors.heads import HeadFactory
from drivers.simulated.sensors.optics import BEAMS, OPTICS
from drivers.simulated.shapes.printed import TARGETS
from drivers.simulated.simulation import Simulation

#: Parsers of the values, by key.
KEYS: Mapping[str, Callable[[str], Any]] = {
    "seed": values.number(int, 0, 2**32 - 1),
    "sensors": values.some_of([*OPTICS, *BEAMS]),
    "rate": values.number(float, 0.1, 200),
    "noise": values.number(float, 0, 10),
    "offset": values.number(float, -0.5, 0.5),
    "wiggle": values.number(float, 0, 0.1),
    "dark": values.number(float, -100, 100),
    "pattern": values.number(float, 0, 0.1),
    "bend": values.number(float, 0, 90),
    "speed": values.number(float, 0, 5),
    "jitter_ms": values.number(float, 0, 100),
    "occluder": values.one_of("none", "hand"),
    "fault": faults.read,
    "turn": values.number(float, 0, 3600),
    "leave": values.interval(0, 3600),
    "stiffness": values.number(float, 0.0005, 10),
    "weight": values.number(float, 0.001, 2),
    "texture": values.one_of("smooth", "fine", "paper"),
    "lens": values.numbers(len(COEFFICIENTS), -1, 1),
    "distance": values.number(float, 0.1, 10),
    "reflectivity": values.number(float, 0.01, 1),
    "tilt": values.number(float, -70, 70),
    "board": values.one_of(*TARGETS),
    "hold": values.number(float, 0, 3600),
    "reach": values.number(float, 0, 3),
    "lens_model": values.one_of("brown_conrady", "fisheye"),
    "order": values.one_of(*ORDERS),
    "blur": values.number(float, 0, 10),
    "crosstalk": values.number(float, 0, 0.5),
    **dict.fromkeys(OPTICS, values.size(16, 2048)),
}

#: Scenes with a surface to track.
MOVING = frozenset(SCENES) - {"wall"}

#: Scenes of the keys that do not apply to all scenes.
SCENES_OF: Mapping[str, frozenset[str]] = {
    "bend": frozenset({"sheet", "board", "pair"}),
    "texture": frozenset({"sheet", "pair"}),
    "turn": frozenset({"sheet", "board", "pair"}),
    "stiffness": frozenset({"strip"}),
    "weight": frozenset({"strip"}),
    "distance": frozenset({"wall"}),
    "reflectivity": frozenset({"wall"}),
    "tilt": frozenset({"wall"}),
    "board": frozenset({"target"}),
    "hold": frozenset({"target"}),
    "reach": frozenset({"target"}),
    "speed": MOVING,
    "occluder": MOVING,
    "leave": MOVING,
}

#: Scenes with a print whose edges are sharper than a pixel, and the blur of the lenses there [px]. A camera with pixels
#: that are sensitive all over and this blur has a modulation transfer of 0.2 at the Nyquist frequency, a usual one.
#: Without both, an edge is in the image where a pixel's centre is: up to half a pixel off, all along.
SHARP: Mapping[str, float] = {"board": 0.5}


@dataclass(frozen=True)
class Address:
    """A parsed address; the fields are its keys.

    Attributes:
        scene: one of `SCENES`.
        seed: random seed of motion, texture and noise.
        sensors: heads, of `OPTICS` and `BEAMS`.
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
        order: filter pattern of the Bayer head, one of `ORDERS`.
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

    def build(self) -> Simulation:
        """The simulation of this address.

        Raises:
            AddressError: invalid lens, or its distortion is not invertible in the image.
        """
        settings = SceneSettings(
            seed=self.seed,
            bend=math.radians(self.bend),
            speed=self.speed,
            excursion=Excursion(self.turn, self.leave),
            hand=self.occluder == "hand",
            texture=self.texture,
            stiffness=self.stiffness,
            weight=self.weight,
            distance=self.distance,
            reflectivity=self.reflectivity,
            tilt=math.radians(self.tilt),
            printed=self.board,
            hold_s=self.hold,
            reach=self.reach,
        )
        factory = HeadFactory(
            sizes=self.sizes,
            rate_hz=self.rate,
            noise=self.noise,
            offset=self.offset,
            wiggle=self.wiggle,
            dark=self.dark,
            pattern=self.pattern,
            lens=self._lens(),
            mosaic=Mosaic(self.order, self.crosstalk),
            samples=2 if self.texture == "fine" or self.scene in SHARP else 1,
            blur_px=self.blur,
        )
        scene = SCENES[self.scene](settings)
        try:
            heads = {name: factory.head(name, scene) for name in self.sensors}
        except LensError as error:
            raise AddressError(f"simulated://{self.scene}: lens = {self.lens} is too strong: {error}") from error
        jitter_ns = round(self.jitter_ms * 1e6)
        return Simulation(scene, heads, self.seed, self.rate, jitter_ns, noisy=self.noise > 0)

    def _lens(self) -> LensModel:
        try:
            return lens_of(self.lens_model, self.lens)
        except LensError as error:
            raise AddressError(f"simulated://{self.scene}: lens_model = {self.lens_model}: {error}") from error


def parse(uri: str) -> Address:
    """Parses an address such as `simulated://sheet?seed=1&sensors=tof,color&color=640x480`.

    Raises:
        AddressError: unknown scene or key, a key that does not apply to the scene or is given twice, or a value outside
            its range; names all three.
    """
    parts = address.split(uri)
    scene = parts.netloc + parts.path
    if scene not in SCENES:
        raise AddressError(f"{uri}: scene {scene!r} is none of {sorted(SCENES)}")
    given = address.values(uri, KEYS)
    for key in given:
        if scene not in SCENES_OF.get(key, SCENES):
            raise AddressError(f"{uri}: {key} means nothing in {scene!r}, only in {sorted(SCENES_OF[key])}")
    sizes = {key: given.pop(key) for key in OPTICS if key in given}
    return Address(scene, sizes=sizes, **{"blur": SHARP.get(scene, 0.0), **given})

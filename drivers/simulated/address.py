"""Addresses `simulated://scene?key=value&…`; unknown keys and values are errors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from calib.lenses.by_name import lens_of
from calib.lenses.lens import COEFFICIENTS, LensError, LensModel
from drivers.contract import address
from drivers.contract import address_values as values
from drivers.contract.device import AddressError
from drivers.simulated import faults
from drivers.simulated.scenes import SCENES
from drivers.simulated.sensors.bayer import ORDERS
from drivers.simulated.sensors.heads import make_head
from drivers.simulated.sensors.optics import BEAMS, OPTICS
from drivers.simulated.settings import SHARP, Settings
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


@dataclass(frozen=True)
class Address(Settings):
    """A parsed address."""

    def build(self) -> Simulation:
        """The simulation of this address.

        Raises:
            AddressError: invalid lens, or its distortion is not invertible in the image.
        """
        scene = SCENES[self.scene](self)
        try:
            heads = {name: make_head(name, scene, self, self._lens()) for name in self.sensors}
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

"""What an address `simulated://scene?key=value&…` asks for; whatever is not understood is an error, never ignored."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar
from urllib.parse import parse_qsl, urlsplit

from calib import pose
from calib.camera import Camera
from drivers.device import AddressError
from drivers.simulated import scene
from drivers.simulated.color import SIGMA, Bayer, Color
from drivers.simulated.exposure import Head
from drivers.simulated.scene import Scene
from drivers.simulated.simulation import Simulation
from drivers.simulated.structured_light import StructuredLight, StructuredLightNoise
from drivers.simulated.time_of_flight import TimeOfFlight, TimeOfFlightNoise

Number = TypeVar("Number", int, float)

SCENES: Mapping[str, Callable[[int, float, float], Scene]] = {"sheet": scene.sheet, "board": scene.board}


@dataclass(frozen=True)
class Optics:
    """Geometry of a head: default size [px], focal length per image width, position in the rig [m]."""

    width: int
    height: int
    focal_ratio: float
    position: tuple[float, float, float]

    def camera(self, width: int, height: int) -> Camera:
        """A camera without lens distortion that sees the same angle in `width` pixels."""
        focal = self.focal_ratio * width
        T_rs = pose.from_rotation_vector((0, 0, 0), self.position)
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, T_rs=T_rs)


#: The heads there are. The rig's frame is that of `tof`, whose geometry is that of a SwissRanger SR4000.
OPTICS: Mapping[str, Optics] = {
    "tof": Optics(176, 144, 220 / 176, (0.0, 0.0, 0.0)),
    "color": Optics(320, 240, 275 / 320, (0.05, 0.0, 0.0)),
    "structured_light": Optics(320, 240, 288 / 320, (-0.06, 0.0, 0.0)),
    "bayer": Optics(320, 240, 275 / 320, (0.05, 0.03, 0.0)),
}


#: Lowest and highest value of the keys that are numbers; width and height of images [px].
RANGES: Mapping[str, tuple[float, float]] = {
    "rate": (0.1, 200),
    "noise": (0, 10),
    "offset": (-0.5, 0.5),
    "bend": (0, 90),
    "speed": (0, 5),
    "jitter_ms": (0, 100),
}
SIZES = (16, 2048)


@dataclass(frozen=True)
class Address:
    """A simulated device as its address describes it; the fields are the address's keys.

    Attributes:
        scene: one of `SCENES`.
        seed: of motion, texture and noise.
        sensors: heads, of `OPTICS`.
        sizes: width and height [px] of heads that differ from their default; in the address `color=640x480`.
        rate: exposures per second [Hz].
        noise: factor on all random errors; 0 leaves only what digits do.
        offset: mean offset of the time-of-flight head's distances [m].
        bend: largest bend of the sheet from end to end [degrees].
        speed: factor on the speed of all motion.
        jitter_ms: standard deviation of the error of the frames' stamps [ms].
    """

    scene: str
    seed: int = 1
    sensors: tuple[str, ...] = ("tof", "color")
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    rate: float = 30.0
    noise: float = 1.0
    offset: float = 0.0
    bend: float = 60.0
    speed: float = 1.0
    jitter_ms: float = 0.0

    def build(self) -> Simulation:
        """The world that the address describes."""
        world = SCENES[self.scene](self.seed, math.radians(self.bend), self.speed)
        heads = {name: self._head(name, world) for name in self.sensors}
        return Simulation(world, heads, self.seed, self.rate, round(self.jitter_ms * 1e6))

    def _head(self, name: str, world: Scene) -> Head:
        optics = OPTICS[name]
        camera = optics.camera(*self.sizes.get(name, (optics.width, optics.height)))
        if name == "tof":
            return TimeOfFlight(name, camera, world, self.rate, self._time_of_flight_noise())
        if name == "structured_light":
            random = self.noise * StructuredLightNoise.random
            return StructuredLight(name, camera, world, self.rate, StructuredLightNoise(random=random))
        picture = {"color": Color, "bayer": Bayer}[name]
        return picture(name, camera, world, self.rate, self.noise * SIGMA)

    def _time_of_flight_noise(self) -> TimeOfFlightNoise:
        default = TimeOfFlightNoise()
        return replace(
            default,
            mu_offset=self.offset,
            sigma_offset=self.noise * default.sigma_offset,
            sigma_distance=self.noise * default.sigma_distance,
            sigma_amplitude=self.noise * default.sigma_amplitude,
            amplitude=self.noise * default.amplitude,
        )


def parse(uri: str) -> Address:
    """Reads an address such as `simulated://sheet?seed=1&sensors=tof,color&color=640x480`.

    Raises:
        AddressError: unknown scene or key, a key given twice, or a value outside its range; names all three.
    """
    parts = urlsplit(uri)
    name = parts.netloc + parts.path
    if name not in SCENES:
        raise AddressError(f"{uri}: scene {name!r} is none of {sorted(SCENES)}")
    fields: dict[str, Any] = {}
    sizes: dict[str, tuple[int, int]] = {}
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        if key in fields or key in sizes:
            raise AddressError(f"{uri}: {key} is given twice")
        if key in OPTICS:
            sizes[key] = _size(uri, key, value)
        elif key == "sensors":
            fields[key] = _sensors(uri, value)
        elif key == "seed":
            fields[key] = _number(uri, key, value, int, (0, 2**32 - 1))
        elif key in RANGES:
            fields[key] = _number(uri, key, value, float, RANGES[key])
        else:
            raise AddressError(
                f"{uri}: unknown key {key!r}; allowed are {sorted(['seed', 'sensors', *RANGES, *OPTICS])}"
            )
    return Address(name, sizes=sizes, **fields)


def _number(uri: str, key: str, value: str, kind: type[Number], allowed: tuple[float, float]) -> Number:
    try:
        number = kind(value)
    except ValueError:
        number = None
    if number is None or not allowed[0] <= number <= allowed[1]:
        raise AddressError(f"{uri}: {key} = {value!r} must be a number from {allowed[0]:g} to {allowed[1]:g}")
    return number


def _sensors(uri: str, value: str) -> tuple[str, ...]:
    names = tuple(value.split(","))
    if not set(names) <= set(OPTICS) or len(set(names)) != len(names):
        raise AddressError(f"{uri}: sensors = {value!r} must be one or more of {sorted(OPTICS)}, each once")
    return names


def _size(uri: str, key: str, value: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", value)
    width, height = (int(number) for number in match.groups()) if match else (0, 0)
    if not (SIZES[0] <= width <= SIZES[1] and SIZES[0] <= height <= SIZES[1]):
        raise AddressError(f"{uri}: {key} = {value!r} must be WIDTHxHEIGHT, each from {SIZES[0]} to {SIZES[1]}")
    return width, height

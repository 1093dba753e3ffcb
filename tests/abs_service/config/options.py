"""A rig file for every exchangeable part: what its table says, and what else of the rig it needs.

A new module of one of the packages is found, and tested in the usual rig with the defaults of its keys. It needs
an entry here only if a key has none, or if it needs another rig.
"""

from dataclasses import dataclass
from string import Template

from abs_service.config import plugins

#: The packages whose modules a rig file names with `type`, by the key of the table.
PACKAGES = {
    "model": "abs_service.tracker.models",
    "synthesis": "abs_service.tracker.synthesis",
    "optimizer": "abs_service.tracker.optimizers",
    "objective": "abs_service.tracker.objectives",
    "region": "abs_service.tracker.detection.regions",
    "template": "abs_service.tracker.detection.templates",
    "depth": "calib.noise",
    "picture": "calib.noise.images",
}

RIG = Template("""\
version = 1
name = "options"

[devices.sim]
uri = "simulated://$scene?seed=3&sensors=$depth_head,$head&$size"

[sensors.tof]
device = "sim"
head = "$depth_head"
noise = $depth
$texture

[sensors.other]
device = "sim"
head = "$head"
noise = $picture

[synchronisation]
reference = "tof/depth"

[trackers.object]
sensors = ["tof", "other"]
model = $model
region = $region
template = $template
synthesis = $synthesis
objective = $objective
optimizer = $optimizer
mesh = { vertices = 150 }

[record]
""")

DEFAULTS = {
    "scene": "sheet",
    "depth_head": "tof",
    "head": "color",
    "size": "tof=88x72&color=128x96",
    "model": '{ type = "nurbs" }',
    "region": '{ type = "nearest" }',
    "template": '{ type = "first_image" }',
    "synthesis": '{ type = "sparse" }',
    "objective": '{ type = "likelihood" }',
    "optimizer": '{ type = "cma", generations = 3 }',
    "depth": '{ type = "tof_amplitude", sigma = [0.0015, 0.0005], sigma_amplitude = 9.0 }',
    "texture": "",
    "picture": '{ type = "color", sigma = 15.0 }',
}

#: Distances and one beam do not say how far a sheet has slid along itself; the amplitudes do.
BARRIER = {
    "head": "barrier",
    "size": "tof=88x72",
    "texture": 'texture = { type = "intensity", stream = "amplitude", sigma = 100.0 }',
}
LENS = {"size": "tof=88x72&color=128x96&lens=-0.25,0.06"}
STRUCTURED_LIGHT = {"depth_head": "structured_light", "size": "structured_light=160x120&color=128x96"}


@dataclass(frozen=True)
class Option:
    """A rig in which one part is as it is tested.

    Attributes:
        part: key of the table that names the part, and its type, say `model.rigid`.
        keys: other keys of that table.
        others: what else differs from `DEFAULTS`.
    """

    part: str
    keys: str
    others: dict[str, str]

    @property
    def module(self) -> str:
        """Dotted name of the part's module."""
        key, _, kind = self.part.partition(".")
        return f"{PACKAGES[key]}.{kind}"

    @property
    def toml(self) -> str:
        """The rig file."""
        key, _, kind = self.part.partition(".")
        table = ", ".join([f'type = "{kind}"', *filter(None, [self.keys])])
        return RIG.substitute(DEFAULTS | self.others | {key: f"{{ {table} }}"})


def _option(part: str, keys: str = "", **others: str) -> Option:
    return Option(part, keys, others)


#: Parts that are not tested with their defaults in the usual rig.
SPECIAL = {
    option.part: option
    for option in (
        _option("model.nurbs", "control_points = [5, 4], degree = 3"),
        _option("model.rigid", scene="board"),
        _option("model.flexpad", "width_m = 0.3, height_m = 0.2"),
        _option("model.gravity", "segments = 3, length_m = 0.3", scene="strip", size="tof=176x144&color=160x120"),
        _option("model.posed", 'shape = { type = "nurbs", control_points = [3, 3], degree = 2 }'),
        _option("synthesis.undistorted", **LENS),
        _option("synthesis.warped", 'sensor = "tof"', size="tof=176x144&color=160x120&lens=-0.25,0.06"),
        _option("synthesis.dense", "step = 2", **LENS),
        _option("optimizer.cma", "generations = 5"),
        _option("optimizer.cma_es", "generations = 5, population = 12"),
        _option("optimizer.hybrid", "steps = 2, fallback_above = 0.05"),
        _option("objective.likelihood", "outlier_share = 0.1"),
        _option("region.nearest", "maximum_step_m = 0.05"),
        _option("region.box", "lowest = [-0.3, -0.3, 0.7], highest = [0.3, 0.3, 1.3]"),
        _option("region.mask", 'file = "mask.png"'),
        _option("region.seed", 'pixel = [44, 36], within = "mask.png"'),
        _option("region.above_plane", "clearance_m = 0.03"),
        _option("region.distance", "maximum_m = 1.2"),
        _option("template.sheet", "size = [0.2, 0.3]"),
        _option("template.mesh", 'path = "sheet.ply", unit = "mm"'),
        _option("depth.constant", "sigma = 0.0045"),
        _option("depth.gaussian_polynomial", "sigma = [[0.002, 0.0], [0.0025, 0.0]]"),
        _option("depth.tof_amplitude", "sigma = [0.0015, 0.0005], sigma_amplitude = 9.0"),
        _option("depth.pixel_polynomial", 'file = "pixels.npz"'),
        _option("depth.region_polynomial", 'file = "regions.npz"'),
        _option("depth.per_pixel", 'file = "own.npz", model = { type = "constant", sigma = 0.0045 }'),
        _option("depth.measured", "factor = 1.5, floor = 0.001"),
        _option("depth.structured_light", "noise = 1.425e-3, step = 2.85e-3", **STRUCTURED_LIGHT),
        _option("picture.color", "sigma = 20.0"),
        _option("picture.grey", "sigma = 15.0"),
        _option("picture.bayer", "sigma = 15.0", head="bayer", size="tof=88x72&bayer=128x96"),
        _option("picture.intensity", 'stream = "ir", sigma = 50.0', head="ir", size="tof=88x72&ir=128x96"),
        _option("picture.binary", "length_m = 0.8485", **BARRIER),
    )
}

_FOUND = [f"{key}.{name}" for key, package in PACKAGES.items() for name in plugins.available(package)]

#: By part, "model.rigid".
OPTIONS = {part: _option(part) for part in _FOUND} | SPECIAL

"""Everything that a rig file can choose runs: as `track` prepares it, and as `replay` tracks it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from abs_service import cli, config, wiring
from abs_service.config import plugins
from abs_service.supervision.exit_codes import Exit
from abs_service.tracking.warmup.board import warm_up
from calib.noise.constant import Constant
from calib.noise.per_pixel import PerPixel
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial, blocks
from drivers.contract.device import Truth
from drivers.contract.frame import Frame, Kind
from drivers.simulated.address import parse
from drivers.simulated.sensors.exposure import Head
from drivers.simulated.sensors.time_of_flight import SIGMA_POLYNOMIAL
from drivers.simulated.simulation import Simulation
from tests.abs_service.commands.recordings.simulated_recording import write_take
from tests.abs_service.config.options import OPTIONS, PACKAGES, SPECIAL

#: From the last moment of rest until everything moves.
EXPOSURES = range(28, 40)
#: Of the time-of-flight image of the options' rigs.
WIDTH, HEIGHT = 88, 72


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files that parts read: noise of every pixel and region, and a mask of the sheet at rest."""
    made = tmp_path_factory.mktemp("rigs")
    sigma = np.array(SIGMA_POLYNOMIAL)
    domain = np.array([0.1, 5.0]), np.array([400.0, 10_000.0])
    labels = blocks(HEIGHT, WIDTH, 16)
    tables = np.repeat(sigma[..., None], int(labels.max()) + 1, axis=-1)
    RegionPolynomial(labels, tables, 0 * tables, *domain).save(made / "regions.npz")
    maps = np.tile(sigma[..., None, None], (1, 1, HEIGHT, WIDTH))
    PixelPolynomial(maps, 0 * maps, *domain).save(made / "pixels.npz")
    own = np.zeros((1, HEIGHT, WIDTH)), np.ones((HEIGHT, WIDTH))
    PerPixel(Constant(0.0045), *own, domain[0]).save(made / "own.npz")
    depth = parse(f"simulated://sheet?seed=3&sensors=tof&tof={WIDTH}x{HEIGHT}").build().frames(28)[0]
    cv2.imwrite(str(made / "mask.png"), np.where(depth.si() < 1.2, 255, 0).astype(np.uint8))
    trimesh.Trimesh([[-150, -100, 0], [150, -100, 0], [150, 100, 0], [-150, 100, 0]], [[0, 2, 1], [0, 3, 2]]).export(
        made / "sheet.ply"
    )
    return made


@dataclass(frozen=True)
class WithDeviation:
    """A simulation whose depth cameras also deliver σ of each distance."""

    simulation: Simulation

    @property
    def heads(self) -> Mapping[str, Head]:
        return self.simulation.heads

    def truths(self, k: int) -> list[Truth]:
        return self.simulation.truths(k)

    def frames(self, k: int) -> list[Frame]:
        frames = self.simulation.frames(k)
        return [*frames, *(_deviation(frame) for frame in frames if frame.kind == Kind.DEPTH)]


def _deviation(depth: Frame) -> Frame:
    steps = np.full_like(depth.data, round(0.0045 / depth.scale))
    return replace(depth, stream="deviation", kind=Kind.DEVIATION, data=steps)


@pytest.fixture(scope="module")
def take(folder):
    """Makes the recording of a rig's device, once for all rigs with the same one."""

    @cache
    def made(uri: str, heads: tuple[tuple[str, str], ...]) -> Path:
        path = folder / f"{len(list(folder.glob('*.mcap')))}.mcap"
        return write_take(path, WithDeviation(parse(uri).build()), EXPOSURES, dict(heads))

    return made


def test_rigs_are_of_parts_that_are_there():
    there = {f"{package}.{name}" for package in PACKAGES.values() for name in plugins.available(package)}
    assert {option.module for option in SPECIAL.values()} <= there


def parts(rig):
    """`Settings` of all exchangeable parts."""
    tracker = rig.trackers["object"]
    chosen = [getattr(tracker, name) for name in ("model", "region", "template", "synthesis", "objective", "optimizer")]
    return [*chosen, *(sensor.noise for sensor in rig.sensors.values())]


@pytest.mark.parametrize("part", OPTIONS)
def test_a_part_is_prepared_and_tracks_what_was_recorded(part, folder, take, tmp_path, capsys):
    rig_file = folder / "rig.toml"
    rig_file.write_text(OPTIONS[part].toml, encoding="utf-8")
    rig = config.load(rig_file)
    assert OPTIONS[part].module in {type(settings).__module__ for settings in parts(rig)}
    uri = rig.devices["sim"].uri
    heads = parse(uri).build().heads
    cameras = wiring.cameras(rig, {name: heads[head].camera for head, name in rig.heads("sim").items()})
    warm_up(wiring.rig(rig, "object", cameras), wiring.plan(rig, "object"))
    recording = take(uri, tuple(rig.heads("sim").items()))
    arguments = ["replay", recording, "--config", rig_file, "--out", tmp_path / "out.mcap", "--json"]
    assert cli.main(list(map(str, arguments))) == Exit.OK
    estimates = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(estimates) == len(EXPOSURES)
    assert {estimate["status"] for estimate in estimates} == {"TRACKING"}
    assert max(estimate["error_mm"] for estimate in estimates) < 6  # half a pixel of these small images

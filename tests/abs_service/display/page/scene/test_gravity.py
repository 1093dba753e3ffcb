"""The direction of gravity comes from the configuration that a rig publishes, and is an arrow in the scene."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from absmsg.v1.sensor_model_pb2 import Config

from abs_service import config
from abs_service.bus import keys
from abs_service.bus.contract import EVENTS
from abs_service.display.page.feed import Feed
from abs_service.display.page.scene import gravity
from abs_service.display.page.scene.fields import MeshView
from tests.abs_service.bus.loopback import LoopbackBus

STRIP = Path(__file__).parents[5] / "examples" / "rigs" / "gravity.toml"


def down(toml, tracker="strip"):
    bus = LoopbackBus()
    feed = Feed(bus, lambda: 0)
    assert gravity.down(feed, tracker) is None
    bus.publisher(keys.CONFIG, Config.DESCRIPTOR.full_name, EVENTS).put(Config(toml=toml).SerializeToString())
    return gravity.down(feed, tracker)


def test_a_tracker_whose_model_has_gravity_has_its_direction_and_others_have_none():
    toml = config.to_toml(config.load(STRIP))
    assert down(toml) == (0.0, 1.0, 0.0)
    assert down(toml, "other") is None
    assert down(config.to_toml(config.load_default()), "sheet") is None


@pytest.mark.parametrize(
    ("model", "direction"),
    [
        ("{ gravity = [0, 0, -2] }", (0.0, 0.0, -1.0)),
        ("{ gravity = [0, 0, 0] }", None),
        ("{ gravity = [nan, 0, 1] }", None),
        ("{ gravity = [0, 1] }", None),
        ('{ gravity = "down" }', None),
        ("7", None),
    ],
)
def test_only_a_direction_is_one(model, direction):
    assert down(f"[trackers.strip]\nmodel = {model}\n") == direction


@pytest.mark.parametrize("toml", ["= no TOML", "trackers = 3", "[trackers]\nstrip = 3"])
def test_a_configuration_that_is_none_has_no_gravity(toml):
    assert down(toml) is None


def test_the_arrow_begins_in_the_mesh_and_is_drawn_once():
    viser, scene = pytest.importorskip("viser"), pytest.importorskip("abs_service.display.page.scene.scene")
    first, empty = np.array([[0.0, 0, 1], [0.2, 0, 1], [0, 0.4, 1]]), np.empty((0, 6))
    view = MeshView(first, first, np.array([[0, 1, 2]], np.int32), empty, np.empty((0, 0)), None)
    with redirect_stdout(StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    drawn, add = [], server.scene.add_arrows
    server.scene.add_arrows = lambda *arguments, **options: drawn.append(add(*arguments, **options))
    shown = scene.Scene(server)
    for direction in (None, (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)):
        shown.show_gravity("strip", view, direction)
    with redirect_stdout(StringIO()):
        server.stop()
    (arrow,) = drawn
    ((start, end),) = arrow.points
    assert start == pytest.approx(first.mean(axis=0))
    assert end - start == pytest.approx([0, scene.GRAVITY_LENGTH * np.hypot(0.2, 0.4), 0])

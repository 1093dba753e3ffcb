"""The scene in a browser, without a rig."""

import time
from contextlib import nullcontext, redirect_stdout
from io import StringIO
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

viser = pytest.importorskip("viser")

from abs_service.display.page.scene.fields import MeshView  # noqa: E402 - needs viser
from abs_service.display.page.scene.scene import LOADED, STALE, Scene  # noqa: E402 - needs viser
from tests.system.running import wait_until  # noqa: E402 - needs viser

PATIENCE_S = 30

#: Counts the shaders that a page compiles.
COUNT = """
window.compiled = 0
const link = WebGL2RenderingContext.prototype.linkProgram
WebGL2RenderingContext.prototype.linkProgram = function (program) { window.compiled++; link.call(this, program) }
"""

TRIANGLE = np.array([[-0.1, -0.1, 1.0], [0.1, -0.1, 1.0], [0.0, 0.1, 1.0]])


@pytest.fixture
def server():
    with redirect_stdout(StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
        yield server
        server.stop()


def view_of(vertices):
    return MeshView(vertices, TRIANGLE, np.arange(3, dtype=np.int32)[None], np.empty((0, 6)), np.empty((0, 0)), None)


def show(scene, step):
    """A mesh and points that have moved, in another colour."""
    vertices = TRIANGLE + np.array([0, 0, 0.003 * step])
    scene.show_mesh("sheet", view_of(vertices), np.full((3, 3), 40 + 2 * step, np.uint8), stale=False)
    scene.show_points("tof", vertices.repeat(2, axis=0).astype(np.float32), 0.05, stale=False, visible=True)


class Recorder:
    """A server that keeps what is seen of a mesh."""

    def __init__(self):
        self.files = []

    def seen(self):
        """Colour of what is visible."""
        (visible,) = [file for file in self.files if file.visible]
        return visible.glb_data

    def add_glb(self, name, data, visible=True, **options):
        if name.startswith("/mesh/"):
            self.files.append(SimpleNamespace(glb_data=data, visible=visible))
            return self.files[-1]
        return None

    def __getattr__(self, name):
        return self if name == "scene" else lambda *_, **__: nullcontext() if name == "atomic" else {}


def test_the_last_mesh_is_seen_also_if_none_follows(monkeypatch):
    """As when the rig is gone and the mesh turns grey, in a pause of a recording, or after a step in it."""
    monkeypatch.setattr("abs_service.display.page.scene.scene.glb", lambda vertices, faces, colors: tuple(colors[0]))
    server = Recorder()
    scene = Scene(cast(Any, server))

    def show(grey, stale=False):
        scene.show_mesh("sheet", view_of(TRIANGLE), np.full((3, 3), grey, np.uint8), stale)

    for grey in (10, 20, 30):
        show(grey)
    assert server.seen() == (20, 20, 20)  # the last one is being loaded
    for _ in range(LOADED):
        scene.settle("sheet")
    assert server.seen() == (30, 30, 30)
    show(30, stale=True)
    assert server.seen() == (30, 30, 30)  # none before it is seen again
    for _ in range(2 * LOADED):
        scene.settle("sheet")
    assert server.seen() == STALE
    show(40)
    show(50)
    assert server.seen() == (40, 40, 40)


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.timeout(120)
def test_what_moves_is_drawn_without_compiling_shaders_again(server, browser):
    scene = Scene(cast(Any, server))
    show(scene, 0)
    page = browser.new_page(viewport={"width": 500, "height": 300})
    page.set_default_timeout(1e3 * PATIENCE_S)
    page.add_init_script(COUNT)
    page.goto(f"http://127.0.0.1:{server.get_port()}")
    for begin in (1, 31):  # the first time, every shader is new
        before, compiled = page.locator("canvas").first.screenshot(), page.evaluate("window.compiled")
        for step in range(begin, begin + 30):
            show(scene, step)
            time.sleep(1 / 30)  # as a rig sends them
        wait_until(
            lambda before=before: page.locator("canvas").first.screenshot() != before, PATIENCE_S, "another picture"
        )
    assert 0 < page.evaluate("window.compiled") == compiled

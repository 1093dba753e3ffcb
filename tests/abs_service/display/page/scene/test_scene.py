"""The scene in a browser, without a rig."""

import time
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import pytest

viser = pytest.importorskip("viser")

from abs_service.display.page.scene.fields import MeshView  # noqa: E402 - needs viser
from abs_service.display.page.scene.scene import Scene  # noqa: E402 - needs viser
from tests.system.running import wait_until  # noqa: E402 - needs viser

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(120)]

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


def show(scene, step):
    """A mesh and points that have moved, in another colour."""
    vertices = TRIANGLE + np.array([0, 0, 0.003 * step])
    view = MeshView(vertices, TRIANGLE, np.arange(3, dtype=np.int32)[None], np.empty((0, 6)), np.empty((0, 0)), None)
    scene.show_mesh("sheet", view, np.full((3, 3), 40 + 2 * step, np.uint8), stale=False)
    scene.show_points("tof", vertices.repeat(2, axis=0).astype(np.float32), 0.05, stale=False, visible=True)


def test_what_moves_is_drawn_without_compiling_shaders_again(server, browser):
    scene = Scene(server)
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

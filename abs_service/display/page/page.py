"""The page: reads the feed and updates scene and panel, a few times a second each, while a browser is connected."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from os import devnull

import numpy as np
import viser
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh

from abs_service.bus import keys
from abs_service.display.page import pictures
from abs_service.display.page.acting.choosing import Choosing, Measured
from abs_service.display.page.acting.commands import Commands
from abs_service.display.page.acting.controls import DeviceControls
from abs_service.display.page.acting.gestures import Gestures, Ray
from abs_service.display.page.acting.recording import ask, unavailable
from abs_service.display.page.acting.reinitialization import Reinitialization
from abs_service.display.page.feed import Feed
from abs_service.display.page.own_pages import own_pages_only
from abs_service.display.page.panel import Button, Panel
from abs_service.display.page.readouts import status, table, words
from abs_service.display.page.readouts.neighbours import Neighbour, links
from abs_service.display.page.readouts.plots import plots
from abs_service.display.page.scene import gravity
from abs_service.display.page.scene.fields import FIELDS, ColorScale, MeshView, ShownMesh, joined, residual
from abs_service.display.page.scene.scene import Scene
from abs_service.display.page.scene.trails import Trails
from abs_service.tracking.log.tracker_log import points
from calib.camera import Camera
from drivers.contract.frame import Frame, Kind

#: Periods of the page: mesh, points and images, words and plots [s]; without a browser [s].
MESH_S, IMAGES_S, WORDS_S, IDLE_S = 1 / 30, 0.25, 1.0, 0.5

#: Largest difference in time between a mesh and an image of the same exposure [ns].
SAME_NS = 20_000_000

#: Buttons that the recorder may have no use for.
RECORDING = START, STOP = "Start recording", "Stop recording"

#: The page listens here only.
HOST = "127.0.0.1"


class Page:
    """One page of one rig.

    Args:
        feed: of the rig.
        silence: what to do while nothing is received from the rig, in words.
        port: to listen at; the next free one is taken.
        view_only: True leaves out everything that acts on the rig.
        commands: to the rig.
        clock: monotonic time [ns].

    Attributes:
        neighbours: other rigs, to which there are links.
    """

    def __init__(
        self, feed: Feed, silence: str, port: int, view_only: bool, commands: Commands, clock: Callable[[], int]
    ) -> None:
        self._feed, self._silence, self._references, self._clock = feed, silence, commands.references, clock
        with _quiet(), own_pages_only():
            self._server = viser.ViserServer(HOST, port, label="abs-service", verbose=False)
        self.neighbours: Sequence[Neighbour] = ()
        self._scene = Scene(self._server)
        self._gestures, self._trails = Gestures(self._server.scene), Trails()
        self._panel = Panel(self._server, ({} if view_only else self._buttons()) | self._trail_buttons())
        self._reinitialization = Reinitialization(feed, commands.reinitialize, self._panel.answer)
        self._choosing = Choosing(self._gestures, self._look, self._panel.answer, self._reinitialization.ask)
        self._record = commands.record
        if not view_only:
            tab = self._panel.add_tab("Devices")
            self._controls = DeviceControls(self._server.gui, tab, commands.devices, commands.control)
        self._scales = {name: ColorScale(field) for name, field in FIELDS.items()}
        self._drawn: dict[str, ShownMesh] = {}  # by tracker
        self._measured: dict[str, Measured] = {}  # by sensor
        self._due_s = dict.fromkeys((self._draw_meshes, self._draw_images, self._write), 0.0)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self._server.get_port()}"

    @property
    def gui(self) -> viser.GuiApi:
        """The panel, for further controls."""
        return self._server.gui

    def run(self, stop: threading.Event, tick: Callable[[], None]) -> None:
        """Updates the page until it is stopped; calls `tick` at least twice a second."""
        periods_s = {self._draw_meshes: MESH_S, self._draw_images: IMAGES_S, self._write: WORDS_S}
        while not stop.is_set():
            tick()
            self._feed.watch(looked_at := bool(self._server.get_clients()))
            now_s = 1e-9 * self._clock()
            for draw in periods_s if looked_at else ():
                if now_s >= self._due_s[draw]:
                    self._due_s[draw] = max(self._due_s[draw] + periods_s[draw], now_s)
                    draw()
            stop.wait(max(self._due_s[self._draw_meshes] - 1e-9 * self._clock(), 0.002) if looked_at else IDLE_S)

    def close(self) -> None:
        """Ends the server."""
        with _quiet():
            self._server.stop()

    def _draw_meshes(self) -> None:
        for tracker in self._feed.trackers():
            self._draw_mesh(tracker)

    def _draw_mesh(self, tracker: str) -> None:
        found, before = self._feed.newest(keys.mesh(tracker), DeformedMesh), self._drawn.get(tracker)
        if found is None or not (mesh := found[0]).vertices_f32:
            return
        stale, name = found[1] > words.STALE_S, self._panel.field
        state = mesh.header.boot_id, mesh.header.seq, stale, name, self._panel.shows
        if before and before.state == state:
            self._scene.settle(tracker)
            return
        if (view := self._mesh_view(mesh, name == "residual")) is None:
            return
        self._drawn[tracker] = ShownMesh(view, mesh.header.t_host_ns, state)
        self._scene.show_mesh(tracker, view, self._scales[name].colors(FIELDS[name].values(view)), stale)
        self._scene.show_first(tracker, view, self._panel.shows.first_pose)
        self._scene.show_gravity(tracker, view, gravity.down(self._feed, tracker))
        self._trails.extend(tracker, (mesh.header.boot_id, mesh.mesh_version), self._drawn[tracker], self._feed.now_s)
        self._scene.show_trails(tracker, self._trails.lines(tracker))

    def _mesh_view(self, mesh: DeformedMesh, with_image: bool) -> MeshView | None:
        """View of a mesh to draw; None as long as its faces are unknown."""
        if (topology := self._feed.topology(mesh)) is None:
            return None
        measured, camera = np.empty((0, 0)), None
        for topic in self._feed.streams() if with_image else ():
            found = self._feed.frame(topic, mesh.header.t_host_ns)
            if found and found[0].kind == Kind.DEPTH and (camera := self._camera(found[0])):
                measured = pictures.radial(found[0], camera)
                break
        return MeshView(
            points(mesh.vertices_f32).astype(float),
            points(topology.rest_vertices_f32).astype(float),
            np.frombuffer(topology.faces_u32, "<u4").reshape(-1, 3).astype(np.int32),
            np.frombuffer(mesh.covariance_f32, "<f4").reshape(-1, 6).astype(float),
            measured,
            camera,
            mesh.rim_classes_u8,
        )

    def _camera(self, frame: Frame) -> Camera | None:
        """The camera in whose view a frame is; None if it is unknown or of another size."""
        camera = self._feed.cameras().get(frame.aligned_to or frame.sensor)
        return camera if camera and (camera.height, camera.width) == frame.data.shape[:2] else None

    def _draw_images(self) -> None:
        self._scene.show_cameras(self._feed.cameras(), self._panel.shows.cameras)
        chosen = self._drawn.get(self._panel.tracker)
        vertices, faces, classes = joined(one.view for one in self._drawn.values())
        for topic in self._feed.streams():
            found = self._feed.frame(topic, chosen.exposure_ns if chosen else 0)
            if found is None or (camera := self._camera(found[0])) is None:
                continue
            frame, age_s = found
            stale = age_s > words.STALE_S
            image = pictures.picture(frame)
            if frame.kind == Kind.DEPTH:
                measured = self._measured[frame.sensor] = Measured(pictures.radial(frame, camera), camera)
                points_r, _, spacing_m = pictures.cloud(measured.distance, camera)
                self._scene.show_points(frame.sensor, points_r, spacing_m, stale, self._panel.shows.points)
            drawn = pictures.with_mesh(pictures.grey(image) if stale else image, camera, vertices, faces, classes)
            name = topic.removesuffix("/image")
            self._panel.show_image(name, words.stream(name, age_s, self._feed.image_rate_hz(topic)), drawn)
            if frame.kind == Kind.DEPTH:
                self._draw_residual(name, frame, camera, image, stale)

    def _draw_residual(self, stream: str, frame: Frame, camera: Camera, image: pictures.Picture, stale: bool) -> None:
        """Draws the residual of the mesh over a depth image, while it is wanted."""
        name, chosen = f"{stream} residual", self._drawn.get(self._panel.tracker)
        if not self._panel.shows_residual or stale or chosen is None:
            self._panel.hide_image(name)
            return
        if abs(frame.t_host_ns - chosen.exposure_ns) > SAME_NS:
            return
        scale, measured = self._scales["residual"], pictures.radial(frame, camera)
        view = replace(chosen.view, measured=measured, camera=camera)
        drawn = pictures.with_colors(image, camera, view.vertices, view.faces, residual(view), scale.colors)
        self._panel.show_image(name, f"{stream}, residual up to ± {scale.end:g} mm", drawn)

    def _write(self) -> None:
        self._panel.offer(self._feed.trackers())
        tracker = self._panel.tracker
        numbers = self._feed.numbers(tracker)
        self._panel.show_status(status.lines(self._feed, tracker, self._silence))
        self._panel.show_neighbours(links(self.neighbours))
        if self._drawn:
            self._panel.show_legend(self._scales[self._panel.field].end)
        self._panel.grey(RECORDING, unavailable(self._feed))
        self._panel.show_table(table.rows(self._feed, tracker))
        self._panel.show_plots(plots(numbers, self._trails.sigmas(tracker), self._feed.now_s))
        self._reinitialization.look()

    def _trail_buttons(self) -> dict[str, Button]:
        def follow() -> None:
            self._panel.answer("Click a vertex of a mesh.")
            self._gestures.click(pick)

        def pick(ray: Ray) -> None:
            met = self._trails.follow({tracker: drawn.view for tracker, drawn in self._drawn.copy().items()}, ray)
            self._panel.answer("" if met else "There is no mesh where you clicked.")

        return {
            "Follow a vertex": Button("Draw the trail of the vertex that you click next, over ten seconds", follow),
            "Remove the trails": Button("Follow no vertex any more", self._trails.forget),
        }

    def _buttons(self) -> dict[str, Button]:
        def record(recording: bool) -> None:
            self._panel.answer(ask(self._record, recording))

        return {
            "Reinitialise": Button(
                "Detect the object again, with a new mesh", lambda: self._reinitialization.ask(self._panel.tracker)
            ),
            "Choose the object": Button(
                "Detect the object that you click next", lambda: self._choosing.by_click(self._panel.tracker)
            ),
            "Draw a box": Button(
                "Detect the object in the box that you draw next", lambda: self._choosing.by_box(self._panel.tracker)
            ),
            "Draw a lasso": Button(
                "Detect the object that you click around", lambda: self._choosing.by_lasso(self._panel.tracker)
            ),
            START: Button("Record from now on, with the seconds before", lambda: record(True)),
            STOP: Button("End the recording", lambda: record(False)),
        }

    def _look(self, tracker: str) -> Measured | None:
        """The newest depth image of a tracker's reference; None if there is none."""
        return self._measured.get(self._references.get(tracker, ""))


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppresses what viser prints: standard output is for estimates and notes."""
    with open(devnull, "w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
        yield

"""The 3-D part of the page: mesh, its first pose, trails, gravity, points of the depth sensors, cameras."""

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from abs_service.display.page.scene.fields import MeshView
from abs_service.display.page.scene.gltf import glb
from abs_service.display.page.scene.gravity import Direction
from calib.camera import Camera

#: Colour of first pose, cameras and points, and size of a camera [m].
GHOST, CAMERA, POINT, CAMERA_M = (150, 160, 175), (80, 160, 220), (150, 175, 205), 0.06

#: Colour of trails, which no palette has, and the width of their lines [px].
TRAIL, TRAIL_PX = (255, 80, 190), 3.0

#: Colour of the arrow of gravity; its length and its shaft's radius, as shares of the mesh's extent.
GRAVITY, GRAVITY_LENGTH, GRAVITY_RADIUS = (240, 200, 80), 0.4, 0.008

#: Colour of everything that is stale.
STALE = (70, 70, 70)

#: Diameter of a point, as a share of the distance between neighbours.
POINT_SHARE = 0.1

#: Where the eye of the first view is, seen from the middle of the mesh, in units of the mesh's extent.
EYE = np.array([0.65, -0.6, -1.4])

#: Intensity of the light from everywhere, and from a place above and behind the cameras [m]; π shows a colour as it is.
AMBIENT, LAMP, LAMP_PLACE = 2.0, 1.3, (0.2, -0.6, -1.0)

#: Vertical field of view [rad].
FOV = 0.75

#: Turns of the page without a new mesh, about 0.3 s, after which a browser has loaded the last one.
LOADED = 9


@dataclass(slots=True)
class _Shown:
    """A mesh on the page: the file that is seen, another out of sight, and turns since the latter was replaced."""

    seen: viser.GlbHandle
    hidden: viser.GlbHandle
    turns: int

    def swap(self) -> None:
        """Shows the file that was out of sight."""
        self.hidden.visible, self.seen.visible = True, False
        self.seen, self.hidden = self.hidden, self.seen


class Scene:
    """Draws into the scene of a server. Rigs have y downwards, like their cameras."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._meshes: dict[str, _Shown] = {}  # by tracker
        self._first: dict[str, NDArray[np.float64]] = {}  # vertices when the mesh was first shown
        self._ghosts: dict[str, viser.MeshHandle] = {}
        self._clouds: dict[str, viser.PointCloudHandle] = {}
        self._cameras: dict[str, str] = {}
        self._trails: dict[str, viser.LineSegmentsHandle] = {}
        self._gravity: dict[str, tuple[float, ...]] = {}  # direction and start of each arrow
        server.on_client_connect(self._aim)
        server.scene.set_up_direction("-y")
        _light(server.scene)

    def show_mesh(self, tracker: str, view: MeshView, colors: NDArray[np.uint8], stale: bool) -> None:
        """Shows a tracker's mesh with colours (n, 3): its file is loaded out of sight, and seen when the next comes."""
        data = glb(view.vertices, view.faces, np.full_like(colors, STALE) if stale else colors)
        if tracker not in self._meshes:
            if not self._meshes:
                self._keep_shader(view.vertices.mean(axis=0))
            self._first[tracker] = view.vertices
            for client in self._server.get_clients().values():
                self._aim(client)
            first, second = f"/mesh/{tracker}/0", f"/mesh/{tracker}/1"
            add = self._server.scene.add_glb
            self._meshes[tracker] = _Shown(
                add(first, data, cast_shadow=False), add(second, data, visible=False, cast_shadow=False), LOADED
            )
        shown = self._meshes[tracker]
        with self._server.atomic():
            if shown.turns < LOADED:
                shown.swap()
            shown.hidden.glb_data = data
        shown.turns = 0

    def settle(self, tracker: str) -> None:
        """Shows the last mesh that was sent, if none follows; to be called at every turn without a new one."""
        shown = self._meshes[tracker]
        shown.turns += 1
        if shown.turns == LOADED:
            with self._server.atomic():
                shown.swap()

    def show_first(self, tracker: str, view: MeshView, visible: bool) -> None:
        """Shows the first pose of a tracker's mesh as a net."""
        ghost = self._ghosts.get(tracker)
        if ghost is None or len(ghost.vertices) != len(view.first):
            add = self._server.scene.add_mesh_simple
            options = {"wireframe": True, "opacity": 0.35, "side": "double", "cast_shadow": False}
            first = view.first.astype(np.float32)
            ghost = self._ghosts[tracker] = add(f"/first/{tracker}", first, view.faces, color=GHOST, **options)
        elif not np.array_equal(ghost.vertices, view.first.astype(np.float32)):
            ghost.vertices, ghost.faces = view.first.astype(np.float32), view.faces.astype(np.uint32)
        if ghost.visible != visible:
            ghost.visible = visible

    def show_trails(self, tracker: str, lines: NDArray[np.float32]) -> None:
        """Shows lines (n, 2, 3) [m] along which vertices of a tracker have moved."""
        if len(lines):
            add, width = self._server.scene.add_line_segments, {"thickness": TRAIL_PX, "thickness_units": "screen"}
            self._trails[tracker] = add(f"/trails/{tracker}", lines, TRAIL, **width)
        elif (shown := self._trails.pop(tracker, None)) is not None:
            shown.remove()

    def show_gravity(self, tracker: str, view: MeshView, down: Direction | None) -> None:
        """Shows gravity as an arrow from the middle of the first pose of a tracker's mesh, if it is known."""
        middle = view.first.mean(axis=0)
        if down is None or self._gravity.get(tracker) == (*down, *middle):
            return
        self._gravity[tracker] = *down, *middle
        extent_m = float(np.linalg.norm(np.ptp(view.first, axis=0)))
        end, radius = middle + GRAVITY_LENGTH * extent_m * np.array(down), GRAVITY_RADIUS * extent_m
        name, ends, add = f"/gravity/{tracker}", np.array([[middle, end]]), self._server.scene.add_arrows
        add(name, ends, GRAVITY, shaft_radius=radius, head_radius=3 * radius, head_length=8 * radius)
        self._server.scene.add_label(f"{name}/name", "gravity", position=tuple(end))

    def show_points(
        self, sensor: str, points: NDArray[np.float32], spacing_m: float, stale: bool, visible: bool
    ) -> None:
        """Shows the points (n, 3) [m] of one depth sensor, whose neighbours are about `spacing_m` apart."""
        color = STALE if stale else POINT
        shown = self._clouds.get(sensor)
        if shown is None:
            options = {
                "point_size": POINT_SHARE * spacing_m,
                "precision": "float32",
                "point_shape": "circle",
                "point_shading": "flat",
            }
            add = self._server.scene.add_point_cloud
            self._clouds[sensor] = add(f"/points/{sensor}", points, color, visible=visible, **options)
            return
        with self._server.atomic():
            if shown.visible != visible:
                shown.visible = visible
            if visible:
                shown.points = points
            if tuple(shown.colors.ravel()) != color:  # a browser compiles a shader for every colour that it is sent
                shown.colors = np.array(color, np.uint8)

    def show_cameras(self, cameras: dict[str, Camera], visible: bool) -> None:
        """Shows the field of view of every sensor at its pose."""
        for name, camera in cameras.items():
            if self._cameras.get(name) == f"{camera.calib_id}{visible}":
                continue
            self._cameras[name] = f"{camera.calib_id}{visible}"
            turn, fov = transforms.SO3.from_matrix(camera.T_rs[:3, :3]), 2 * np.arctan2(camera.height / 2, camera.fy)
            self._server.scene.add_camera_frustum(
                f"/cameras/{name}", float(fov), camera.width / camera.height, scale=CAMERA_M, color=CAMERA,
                thickness=0.0015, wxyz=turn.wxyz, position=camera.center, visible=visible,
            )  # fmt: skip
            text = f"/cameras/{name}/name"
            self._server.scene.add_label(text, name, position=(0.0, -CAMERA_M, CAMERA_M), visible=visible)

    def _keep_shader(self, middle: NDArray[np.float64]) -> None:
        """Leaves an invisible mesh in the scene.

        Each pose comes as a new mesh, and a browser compiles the shader again when it has dropped all that it drew.
        """
        self._server.scene.add_glb(
            "/mesh", glb(np.tile(middle, (3, 1)), np.arange(3)[None], np.zeros((3, 3), np.uint8))
        )

    def _aim(self, client: viser.ClientHandle) -> None:
        """Aims the view of a browser at the meshes, from behind the cameras; a narrow one from farther away."""
        if not self._first:
            return
        vertices = np.concatenate([*self._first.values()])
        middle, extent_m = vertices.mean(axis=0), float(np.linalg.norm(np.ptp(vertices, axis=0)))
        camera = client.camera
        eye = middle + EYE * extent_m * max(1.0, 1.0 / camera.aspect)
        camera.position, camera.look_at, camera.fov = eye, middle, FOV


def _light(scene: viser.SceneApi) -> None:
    """Adds plain white light, which leaves the colours of the legend.

    Mirrored surroundings, the server's default, took over half of the time in which a browser without a graphics card
    draws.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/light/everywhere", intensity=AMBIENT)
    scene.add_light_directional("/light/lamp", intensity=LAMP, position=LAMP_PLACE)

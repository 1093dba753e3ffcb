"""Images of the simulated sheet as cameras of today make them, and the mesh that the tracker found there.

python -m evaluation.pictures.overview docs/images/overview.png
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.typing import NDArray

import abs_service as a
from abs_service.tracking.log.truth import closest_points
from drivers.contract.frame import Frame
from drivers.simulated import address
from drivers.simulated.simulation import Simulation

#: The demo rig; `a.load_rig` takes any file, this one comes with the service.
DEMO = Path(__file__).parents[2] / "abs_service" / "config" / "demo.toml"

#: The demo rig's world, as a depth and a colour camera of today see it.
URI = "simulated://sheet?seed=1&tof=640x480&color=640x480&texture=paper"

#: Exposure that is shown: the sheet is bent most in the first ten seconds.
SHOWN = 121


def main() -> None:
    """Tracks the demo rig up to the exposure and draws it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    path = parser.parse_args().picture
    simulation = address.parse(URI).build()
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    tracker = a.load_rig(DEMO).tracker("sheet", cameras=cameras, geometry="radial")
    estimate = [_track(tracker, simulation, k) for k in range(SHOWN + 1)][-1]
    if not len(estimate.faces):
        raise RuntimeError("the demo rig sees no object")
    figure = Figure(figsize=(14, 3.6), layout="constrained")
    near, seen, mesh = (figure.add_subfigure(place) for place in figure.add_gridspec(1, 3))  # whose titles are in line
    _draw_images((near, seen), simulation, estimate)
    _draw_mesh(mesh, simulation, estimate.vertices.astype(float), estimate.faces)
    figure.savefig(path, dpi=90)


def _track(tracker: a.Tracker, simulation: Simulation, k: int) -> a.Estimate:
    images = _images(simulation, k)
    depth, amplitude = (images["tof", stream].si() for stream in ("depth", "amplitude"))
    color = images["color", "color"]
    return tracker.track(depth, time_s=k / simulation.rate_hz, amplitude=amplitude, image=color.data)


def _images(simulation: Simulation, k: int) -> dict[tuple[str, str], Frame]:
    """Images of exposure `k` by sensor and stream."""
    return {frame.key: frame for frame in simulation.expose(k)[0]}


def _draw_images(figures: tuple[SubFigure, SubFigure], simulation: Simulation, estimate: a.Estimate) -> None:
    images = _images(simulation, SHOWN)
    near, seen = (figure.add_subplot() for figure in figures)
    distance = images["tof", "depth"].si()
    middle = float(np.median(np.linalg.norm(estimate.vertices, axis=1)))
    near.imshow(distance, cmap="viridis", vmin=middle - 0.06, vmax=middle + 0.06, interpolation="nearest")
    figures[0].suptitle("time of flight: distance", fontsize=11)
    _crop(near, simulation, "tof", estimate)
    seen.imshow(images["color", "color"].data, interpolation="nearest")
    u, v = simulation.heads["color"].camera.project(estimate.vertices).T
    seen.triplot(u, v, estimate.faces, color="white", linewidth=0.6)
    figures[1].suptitle("colour, with the tracked mesh", fontsize=11)
    _crop(seen, simulation, "color", estimate)


def _crop(axes: Axes, simulation: Simulation, sensor: str, estimate: a.Estimate) -> None:
    pixels = simulation.heads[sensor].camera.project(estimate.vertices)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = 0.15 * (high - low).max()
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(high[1] + margin, low[1] - margin))
    axes.set_axis_off()


def _draw_mesh(
    figure: SubFigure, simulation: Simulation, vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> None:
    truth = simulation.expose(SHOWN)[1].points_r.astype(float)
    error_mm = np.linalg.norm(vertices - closest_points(vertices, truth), axis=1) * 1e3
    points = vertices[:, [0, 2, 1]] * (1, 1, -1)
    axes = figure.add_subplot(projection="3d")
    surface = Poly3DCollection(points[faces], cmap="magma_r", edgecolor="0.3", linewidth=0.2)
    surface.set_array(error_mm[faces].mean(axis=1))
    surface.set_clim(0, 4)
    low, high = points.min(axis=0), points.max(axis=0)
    if isinstance(axes, Axes3D):
        axes.add_collection3d(surface)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1)
        axes.view_init(elev=35, azim=-50)
    axes.set_axis_off()
    figure.suptitle(f"the mesh in space: {error_mm.mean():.1f} mm from the true surface", fontsize=11)
    figure.colorbar(surface, ax=axes, label="distance from the truth [mm]", shrink=0.7)


if __name__ == "__main__":
    main()

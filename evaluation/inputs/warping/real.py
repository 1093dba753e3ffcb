"""The Azure Kinect's frame, warped by every method; without a truth, all are compared with the mesh warp."""

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Column, Picture, Section, Table, drawing
from abs_service.report.plots import figure
from calib.warp.mesh import MeshWarp
from calib.warp.pictures import PictureLookup
from evaluation.inputs.recordings.azure import AzureExposure
from evaluation.inputs.warping.comparison import methods

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def section(exposure: AzureExposure, pool: ThreadPoolExecutor) -> Section:
    """Coverage and differences of each method relative to the mesh warp, with pictures."""
    found = {
        name: method(exposure.distance.astype(np.float64))
        for name, method in methods(exposure.cameras["depth"], exposure.cameras["color"], pool).items()
    }
    ours = found["mesh"]
    rows = []
    for name, distance in found.items():
        both = np.isfinite(distance) & np.isfinite(ours)
        off = 1e3 * (distance - ours)[both]
        share = 100 * np.count_nonzero(both) / np.count_nonzero(np.isfinite(ours))
        rows.append((name, share, float(np.median(off)), float(np.quantile(np.abs(off), 0.95))))
    columns = (Column("method"), Column("of the mesh's pixels", "%", ".1f"), Column("median difference", "mm", "+.2f"))
    table = Table("Depth in the colour camera's view", (*columns, Column("p95", "mm", ".2f")), tuple(rows))
    return Section("Real: one frame of an Azure Kinect", (table, _picture(exposure)))


def _picture(exposure: AzureExposure) -> Picture:
    """Depth and its deviation in the colour camera's view, and colour in the depth camera's, beside the originals."""
    depth, color = exposure.cameras["depth"], exposure.cameras["color"]
    warped = MeshWarp(depth, color).warp(exposure.distance)
    colors = PictureLookup(depth, color).look(exposure.distance).blended(exposure.rgb)
    deviation = 1e3 * warped.deviation(np.full(exposure.distance.shape, 2e-3))
    near, far = (float(limit) for limit in np.nanquantile(exposure.distance, [0.02, 0.98]))
    lengths = {"vmin": near, "vmax": far, "cmap": "viridis"}
    drawn = figure(13, 7.4)
    places = drawn.subplots(2, 3).ravel()
    _show(drawn, places[0], "depth as measured [m]", exposure.distance, lengths)
    _show(drawn, places[1], "depth in the colour camera's view [m]", warped.distance, lengths)
    _show(
        drawn,
        places[2],
        "its deviation [mm], if 2 mm were measured",
        deviation,
        {"vmin": 0, "vmax": 6, "cmap": "magma"},
    )
    _show(drawn, places[3], "colour as seen", exposure.rgb, {})
    _show(drawn, places[4], "colour in the depth camera's view", np.nan_to_num(colors, nan=255).astype(np.uint8), {})
    _show(drawn, places[5], "occluded in the depth camera", warped.hidden(), {"cmap": "gray_r"})
    return drawing(drawn, "One frame of an Azure Kinect (pyk4a's test recording, MIT)", "Depth and colour images")


def _show(drawn: "Figure", axes: "Axes", title: str, pixels: NDArray[Any], style: dict[str, Any]) -> None:
    image = axes.imshow(pixels, interpolation="nearest", **style)
    axes.set_title(title, fontsize=10)
    axes.set_axis_off()
    if "vmin" in style:
        drawn.colorbar(image, ax=axes, shrink=0.7)

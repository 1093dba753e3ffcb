"""Board on a sheet of paper, true to scale, with a ruler, as SVG or PDF."""

import io
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from calib.board.artwork import artwork
from calib.board.target import Target, outline
from calib.files import atomic

#: Margin that printers leave white, and the strip below the board for ruler and text [m].
RIM, STRIP = 0.008, 0.014
#: Longest ruler, and the distance of its ticks [m].
_RULER, _TICK = 0.1, 0.01

_MM = 1e3


class SheetError(ValueError):
    """Board that does not fit on its sheet, or a file that cannot be written."""


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A page.

    Attributes:
        width, height: of the paper [m].
        rectangles: black: left, top, width, height from the paper's upper left corner (n, 4) [m].
        discs: black: x, y, radius (m, 3) [m].
        ruler: left and right end, and y of the line (3,) [m].
        text: one line below the board.
    """

    width: float
    height: float
    rectangles: NDArray[np.float64]
    discs: NDArray[np.float64]
    ruler: NDArray[np.float64]
    text: str


def lay_out(target: Target, width: float, height: float, text: str) -> Sheet:
    """Places a board in the middle of a sheet of paper, with a ruler and a line of text below.

    Raises:
        SheetError: it does not fit; names the required scale.
    """
    corners = outline(target)[:, :2]
    size = np.ptp(corners, axis=0)
    room = np.array([width - 2 * RIM, height - 2 * RIM - STRIP])
    if (size > room).any():
        raise SheetError(
            f"the board is {size[0] * _MM:.0f} × {size[1] * _MM:.0f} mm, but a sheet of {width * _MM:.0f} × "
            f"{height * _MM:.0f} mm has room for {room[0] * _MM:.0f} × {room[1] * _MM:.0f} mm: make its lengths "
            f"{np.floor(100 * (room / size).min()):.0f} % of what they are, or take a larger sheet"
        )
    shift = np.array([RIM, RIM]) + (room - size) / 2 - corners.min(axis=0)
    shapes = artwork(target)
    length = min(_RULER, np.floor(room[0] / _TICK) * _TICK)
    return Sheet(
        width,
        height,
        shapes.rectangles + np.array([*shift, 0, 0]),
        shapes.discs + np.array([*shift, 0]),
        np.array([RIM, RIM + length, height - RIM - 0.004]),
        f"{text}. Print at 100 %, never fit to page: the line is {length * _MM:.0f} mm long.",
    )


def write(sheet: Sheet, path: Path) -> None:
    """Writes a sheet as SVG or PDF, according to the file's suffix.

    Raises:
        SheetError: the file cannot be written.
    """
    content = to_svg(sheet).encode() if path.suffix == ".svg" else to_pdf(sheet)
    try:
        atomic.write(path, content)
    except OSError as error:
        raise SheetError(f"{path}: cannot be written: {error.strerror}") from error


def to_svg(sheet: Sheet) -> str:
    """The sheet as SVG whose unit is the millimetre."""
    width, height = sheet.width * _MM, sheet.height * _MM
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">',
        f'<rect width="{width:g}" height="{height:g}" fill="white"/>',
        '<g fill="black" shape-rendering="crispEdges">',
    ]
    for x, y, w, h in sheet.rectangles * _MM:
        lines.append(f'<rect x="{x:.4f}" y="{y:.4f}" width="{w:.4f}" height="{h:.4f}"/>')
    for x, y, r in sheet.discs * _MM:
        lines.append(f'<circle cx="{x:.4f}" cy="{y:.4f}" r="{r:.4f}"/>')
    lines.append('</g>\n<g stroke="black" stroke-width="0.2">')
    for x0, y0, x1, y1 in _ruler_lines(sheet) * _MM:
        lines.append(f'<line x1="{x0:.4f}" y1="{y0:.4f}" x2="{x1:.4f}" y2="{y1:.4f}"/>')
    x, y = sheet.ruler[0] * _MM, sheet.ruler[2] * _MM + 3.5
    lines.append(f'</g>\n<text x="{x:.2f}" y="{y:.2f}" font-family="sans-serif" font-size="2.6">')
    lines.append(f"{escape(sheet.text)}</text>\n</svg>\n")
    return "\n".join(lines)


def to_pdf(sheet: Sheet) -> bytes:
    """The sheet as PDF of one page; the same sheet gives the same bytes."""
    import matplotlib as mpl  # noqa: PLC0415  imported only when a PDF is written
    from matplotlib.backends.backend_pdf import FigureCanvasPdf  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415
    from matplotlib.patches import Circle, Rectangle  # noqa: PLC0415

    figure = Figure(figsize=(sheet.width / 0.0254, sheet.height / 0.0254))
    FigureCanvasPdf(figure)
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, sheet.width), ylim=(sheet.height, 0))
    axes.set_axis_off()
    for x, y, w, h in sheet.rectangles:
        axes.add_patch(Rectangle((x, y), w, h, facecolor="black", linewidth=0))
    for x, y, r in sheet.discs:
        axes.add_patch(Circle((x, y), r, facecolor="black", linewidth=0))
    for x0, y0, x1, y1 in _ruler_lines(sheet):
        axes.plot([x0, x1], [y0, y1], color="black", linewidth=0.6, solid_capstyle="butt")
    axes.text(sheet.ruler[0], sheet.ruler[2] + 0.0038, sheet.text, fontsize=7)
    buffer = io.BytesIO()
    with mpl.rc_context({"path.simplify": False}):
        figure.savefig(buffer, format="pdf", facecolor="none", metadata={"CreationDate": None})
    return buffer.getvalue()


def _ruler_lines(sheet: Sheet) -> NDArray[np.float64]:
    """Line and ticks of the ruler: x and y of both ends (n, 4) [m]."""
    left, right, y = sheet.ruler
    ticks = np.linspace(left, right, round((right - left) / _TICK) + 1)
    reach = np.where(np.arange(len(ticks)) % 5 == 0, 0.003, 0.002)
    upright = np.stack([ticks, np.full_like(ticks, y), ticks, y - reach], axis=1)
    return np.concatenate([[[left, y, right, y]], upright])

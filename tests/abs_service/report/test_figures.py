"""Pictures of the reports: what they write lies inside of them."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.quiver import QuiverKey

from abs_service.calibration.cameras import figures as solved
from abs_service.report import figures
from calib.solve.validation.cross_validation import Agreement

PIXELS = np.stack(np.meshgrid(np.linspace(0, 639, 9), np.linspace(0, 479, 7)), axis=-1)


def halves():
    return solved.cross_validation(Agreement("left", 0.07, 0.036, PIXELS, np.full_like(PIXELS, 0.05)))


def residuals():
    pixels = PIXELS.reshape(-1, 2)
    return figures.residual_field(pixels, np.full_like(pixels, 0.05), 640, 480)


@pytest.mark.parametrize("draw", [halves, residuals])
def test_how_long_an_arrow_is_can_be_read(draw):
    figure = draw()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes = figure.axes[0]
    (key,) = (child for child in axes.get_children() if isinstance(child, QuiverKey))
    written, title = (text.get_window_extent(canvas.get_renderer()) for text in (key.text, axes.title))
    assert written.y1 <= figure.bbox.y1
    assert written.x1 <= figure.bbox.x1
    assert written.y0 > max(title.y1, axes.get_window_extent().y1)

"""The picture of the page about the simulator: its scenes, as its heads see them.

python -m evaluation.pictures.simulated_scenes docs/images/scenes.png
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from drivers.contract.frame import Frame, Kind
from drivers.simulated.address import parse

#: What is shown: title, address and exposure.
SHOWN = (
    ("sheet?occluder=hand, color", "sheet?occluder=hand&sensors=color", 135),
    ("the same, tof", "sheet?occluder=hand&sensors=tof", 135),
    ("the same, structured_light", "sheet?occluder=hand&sensors=structured_light", 135),
    ("board?lens=-0.25,0.06, ir", "board?sensors=ir&lens=-0.25,0.06", 150),
    ("pair, color", "pair?sensors=color", 150),
    ("strip, color", "strip?sensors=color", 220),
    ("sheet?turn=4, color, 0.13 s later", "sheet?turn=4&sensors=color", 124),
    ("sheet?texture=fine, bayer, enlarged", "sheet?texture=fine&sensors=bayer&bayer=640x480", 100),
)


def main() -> None:
    """Draws the scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    path = parser.parse_args().picture
    figure = Figure(figsize=(12, 5), layout="constrained")
    for place, (title, address, k) in enumerate(SHOWN, start=1):
        frame = parse(f"simulated://{address}&noise=0").build().frames(k)[0]
        axes = figure.add_subplot(2, 4, place)
        axes.set_title(title, fontsize=9)
        axes.set_axis_off()
        if frame.kind == Kind.DEPTH:
            axes.imshow(_visible(frame), cmap="viridis_r", vmin=0.75, vmax=1.75, interpolation="none")
        else:
            axes.imshow(_visible(frame), cmap="gray", interpolation="none")
    figure.savefig(path, dpi=72)


def _visible(frame: Frame) -> np.ndarray:
    if frame.kind == Kind.BAYER:
        return frame.data[200:290, 260:380]
    return frame.data if frame.kind == Kind.COLOR else frame.si()


if __name__ == "__main__":
    main()

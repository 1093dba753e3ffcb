"""Tracks a sheet of paper that two hands bend before a Kinect: python examples/kinect_paper.py FOLDER.

FOLDER holds color_NNNNNN.jpg and depth_NNNNNN.png (16 bit, z in tenths of a millimetre).
Prints number, status and the median distance between mesh and depth image of every frame.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

import abs_service as a

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
paths = sorted(folder.glob("depth_*.png"))
if not paths:
    raise SystemExit(f"{__doc__}\n{folder.resolve()} holds no depth_*.png.")
camera = a.Camera(640, 480, fx=528.0144, fy=528.0144, cx=320, cy=240)
tracker = a.Tracker(depth=camera, color=camera, model=a.Nurbs())
for path in paths:
    number = path.stem.removeprefix("depth_")
    depth_m = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) * 0.0001
    image = cv2.imread(str(folder / f"color_{number}.jpg"), cv2.IMREAD_COLOR_RGB)
    estimate = tracker.track(depth_m, time_s=int(number) / 30, image=image)
    column, row = camera.project(estimate.vertices).round().astype(int).T
    residuals_m = np.abs(estimate.vertices[:, 2] - depth_m[row, column])
    print(f"{number} {estimate.status} {1e3 * np.median(residuals_m):.2f} mm", flush=True)

"""Tracks a sponge in a folder of colour, depth and mask images: python examples/toy_folder.py FOLDER.

FOLDER holds color_NNNNNN.png, depth_mm_NNNNNN.png (16 bit, z in millimetres) and sponge_NNNNNN.png (the object's mask).
Prints number, status and the median distance between mesh and depth image of every frame.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

import abs_service as a

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
paths = sorted(folder.glob("depth_mm_*.png"))
if not paths:
    raise SystemExit(f"{__doc__}\n{folder.resolve()} holds no depth_mm_*.png.")
camera = a.Camera(320, 240, fx=275, fy=275, cx=160, cy=120)
noise = a.noise.StructuredLight(floor=0.001)  # 1 mm: pores are finer than the mesh
tracker = a.Tracker(depth=camera, color=camera, model=a.Nurbs(6, 6), noise=noise, priors={"stretch": 0.1})
for path in paths:
    number = path.stem.removeprefix("depth_mm_")
    depth_m = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) * 0.001
    image = cv2.imread(str(folder / f"color_{number}.png"), cv2.IMREAD_COLOR_RGB)
    mask = cv2.imread(str(folder / f"sponge_{number}.png"), cv2.IMREAD_GRAYSCALE)
    estimate = tracker.track(depth_m, time_s=int(number) / 30, image=image, mask=mask)
    column, row = camera.project(estimate.vertices).round().astype(int).T
    residuals_m = np.abs(estimate.vertices[:, 2] - depth_m[row, column])
    print(f"{number} {estimate.status} {1e3 * np.median(residuals_m):.2f} mm", flush=True)

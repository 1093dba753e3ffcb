"""Calibration boards: their views as OpenCV projects them, images of a renderer, and boards that are bent."""

"""Calibration boards: what they are, where an image shows them, and whether a set of views is enough."""

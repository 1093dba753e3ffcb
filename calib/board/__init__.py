"""Calibration boards: geometry, corner detection, and coverage of a set of views."""

"""Calibration workflow: collection of views, files, reports."""

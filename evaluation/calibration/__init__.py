"""Experiments on camera and noise calibration."""

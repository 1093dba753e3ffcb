"""Inputs of the calibration commands: stored calibrations, cameras, images or detections, live devices."""

"""Calibration, target and exchange files."""

"""Simulated sensors: optics, exposure, noise."""

"""Surfaces of known shape: sheets and mesh files, their samples, and their registration with the first depth image."""
